"""What runs at the IMU's rate: strapdown integration and the propagation of errors, the kernels compiled. Uses geodesy; a
new mechanisation is a kernel here, with its error model in `error_models`.
"""
