# How an image for the RP2040 is built. A board's CMakeLists.txt includes this before project(), and calls
# rp2040_image(NAME SOURCES... ) after it, for NAME.elf, .bin (what is in flash from its first byte on) and .uf2 (to
# drop on the Pico's drive). Its folder has the pins.
if(NOT CMAKE_TOOLCHAIN_FILE)
  set(CMAKE_TOOLCHAIN_FILE ${CMAKE_CURRENT_LIST_DIR}/arm-none-eabi.cmake)
endif()
set(CMAKE_C_STANDARD 11)
set(CMAKE_C_EXTENSIONS OFF)
set(boards ${CMAKE_CURRENT_LIST_DIR})
set(fw ${boards}/..)
set(tools ${fw}/../tools)
set(port ${fw}/port/rp2040)

find_package(Python3 3.10 REQUIRED COMPONENTS Interpreter)

function(rp2040_image name)
  # The same warnings as everywhere (the root's biotac_options), and what a small image wants.
  set(warnings -Wall -Wextra -Wconversion -Wsign-conversion -Werror)
  set(cpu -mcpu=cortex-m0plus -mthumb)
  add_compile_options(${cpu} -g -ffunction-sections -fdata-sections
    "$<$<COMPILE_LANGUAGE:C>:${warnings};-fstack-usage;-fno-common>"
    # The hardware's divider and CRC, in place of a library call of a hundred cycles and a table.
    "$<$<COMPILE_LANGUAGE:C>:SHELL:-include ${port}/divider.h -include ${port}/sniffer.h>")

  # The second-stage boot: assembled, checksummed, and linked as the 256 bytes that the chip's ROM wants to see.
  add_library(boot2_code OBJECT ${port}/boot2.S)
  add_custom_command(OUTPUT boot2_block.S
    COMMAND ${CMAKE_OBJCOPY} -O binary -j .boot2 $<TARGET_OBJECTS:boot2_code> boot2.bin
    COMMAND ${Python3_EXECUTABLE} ${tools}/image/boot2.py boot2.bin boot2_block.S
    DEPENDS boot2_code $<TARGET_OBJECTS:boot2_code> ${tools}/image/boot2.py)

  add_executable(${name} ${ARGN} ${CMAKE_CURRENT_BINARY_DIR}/boot2_block.S)
  set_target_properties(${name} PROPERTIES SUFFIX .elf LINK_DEPENDS ${boards}/pico/pico.ld)
  target_include_directories(${name} PRIVATE
    ${fw}/core ${fw}/app ${fw}/port ${port} ${CMAKE_CURRENT_LIST_DIR})
  target_link_options(${name} PRIVATE ${cpu} -nostartfiles --specs=nano.specs -Wl,--gc-sections
    -Wl,--fatal-warnings -Wl,-Map=${name}.map -T ${boards}/pico/pico.ld)
  include(${boards}/compile_options.cmake)
  board_compile_options(${ARGN})

  add_custom_command(TARGET ${name} POST_BUILD
    COMMAND ${CMAKE_OBJCOPY} -O binary ${name}.elf ${name}.bin
    COMMAND ${Python3_EXECUTABLE} ${tools}/image/note.py ${name}.bin
    COMMAND ${Python3_EXECUTABLE} ${tools}/image/uf2.py ${name}.bin ${name}.uf2
    COMMAND ${Python3_EXECUTABLE} ${tools}/image/check.py ${name}.elf --objdump ${CMAKE_OBJDUMP})
endfunction()
