# Added to an RP2040's image: the second-stage boot, and a .uf2 to drop on its drive.

# Assembled, checksummed, and linked as the 256 bytes that the chip's ROM expects.
add_library(boot2_code OBJECT ${port}/boot2.S)
add_custom_command(OUTPUT boot2_block.S
  COMMAND ${CMAKE_OBJCOPY} -O binary -j .boot2 $<TARGET_OBJECTS:boot2_code> boot2.bin
  COMMAND ${Python3_EXECUTABLE} ${tools}/image/boot2.py boot2.bin boot2_block.S
  DEPENDS boot2_code $<TARGET_OBJECTS:boot2_code> ${tools}/image/boot2.py)
set(port_objects ${CMAKE_CURRENT_BINARY_DIR}/boot2_block.S)
set(port_after COMMAND ${Python3_EXECUTABLE} ${tools}/image/uf2.py ${name}.bin ${name}.uf2)
