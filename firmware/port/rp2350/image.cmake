# What an RP2350's image has beside the rest: a check of the block that its ROM looks for, and a .uf2 for its drive.
set(port_after COMMAND ${Python3_EXECUTABLE} ${tools}/image/uf2.py ${name}.bin ${name}.uf2 --chip rp2350)
