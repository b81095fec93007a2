"""What IMU, receiver and star sensor make of the motion, with seeded errors. Uses motion; a new sensor is a file here."""
