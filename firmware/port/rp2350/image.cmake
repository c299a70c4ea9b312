# Added to an RP2350's image: a check of the ROM's block, and a .uf2 for the drive.
set(port_after COMMAND ${Python3_EXECUTABLE} ${tools}/image/uf2.py ${name}.bin ${name}.uf2 --chip rp2350)
