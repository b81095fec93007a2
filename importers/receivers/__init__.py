"""What streams of several makes of receivers share: frames and their checksums, and RTCM 3. Uses decoding and rows."""
