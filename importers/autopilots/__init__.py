"""Flight logs of autopilots: PX4's ULog and ArduPilot's DataFlash. Uses decoding and rows; a further topic is read here."""
