"""What IMU, receiver, star sensor, wheels and barometer make of the motion, with seeded errors. Uses motion; a new sensor is
a file here."""
