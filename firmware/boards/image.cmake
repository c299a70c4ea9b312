# Builds an image for a microcontroller. A board's CMakeLists.txt includes this before project(), and after it calls
#   gateway_image(NAME PORT CPU LINKER [SOURCES...])   the gateway on that port
#   board_image(NAME PORT CPU LINKER SOURCES...)       another program on it
# PORT is a folder of firmware/port, or two, "rp2 rp2350": a chip family's and the chip's own; CPU the compiler's
# options for the core, LINKER a script in the chip's folder. Makes NAME.elf, NAME.bin (the stored bytes, from the first
# on) and NAME.hex (all, with addresses), with any additions of the chip's image.cmake, and checks it against
# limits.json of the board's folder.
#   emulated_image(NAME IMAGE PORT CPU LINKER [DEFINITIONS...])   the gateway, with tests/target/semihosted.c for bus and
#                                                             flash; the core is IMAGE's, the gateway_image's, as compiled
if(NOT CMAKE_TOOLCHAIN_FILE)
  set(CMAKE_TOOLCHAIN_FILE ${CMAKE_CURRENT_LIST_DIR}/arm-none-eabi.cmake)
endif()
set(CMAKE_C_STANDARD 11)
set(CMAKE_C_EXTENSIONS OFF)
set(boards ${CMAKE_CURRENT_LIST_DIR})
set(fw ${boards}/..)
set(tools ${fw}/../tools)

find_package(Python3 3.10 REQUIRED COMPONENTS Interpreter)
include(${boards}/compile_options.cmake)
option(BIOTAC_NO_LIMITS "an image of a first hack, whose flash, RAM, stack, floats and waits nobody checks" OFF)

# ports: a port's folders; port: the chip's own.
macro(find_port names)
  string(REPLACE " " ";" ports "${names}")
  list(TRANSFORM ports PREPEND ${fw}/port/)
  list(GET ports -1 port)
endmacro()

macro(leave_out_systick sources) # where the port's timer.c is the alarm
  foreach(folder ${ports})
    if(EXISTS ${folder}/timer.c)
      list(FILTER ${sources} EXCLUDE REGEX "/systick_alarm\\.c$")
    endif()
  endforeach()
endmacro()

function(board_image name port_name cpu linker)
  find_port("${port_name}")
  separate_arguments(cpu)
  # The same warnings as everywhere (the root's biotac_options), and options for a small image.
  set(warnings -Wall -Wextra -Wconversion -Wsign-conversion -Werror)
  add_compile_options(${cpu} -g -ffunction-sections -fdata-sections
    "$<$<COMPILE_LANGUAGE:C>:${warnings};-fstack-usage;-fno-common>")
  if(EXISTS ${port}/image.cmake)
    include(${port}/image.cmake)
  endif()
  leave_out_systick(ARGN)
  if(NOT BIOTAC_NO_LIMITS)
    set(check COMMAND ${Python3_EXECUTABLE} ${tools}/image/check.py ${name}.elf --port ${ports}
      --limits ${CMAKE_CURRENT_LIST_DIR}/limits.json --objdump ${CMAKE_OBJDUMP})
  endif()
  add_executable(${name} ${ARGN} ${port_objects})
  file(GLOB scripts ${fw}/port/*/*.ld) # a script may include another one
  list(TRANSFORM ports PREPEND -L OUTPUT_VARIABLE folders)
  set_target_properties(${name} PROPERTIES SUFFIX .elf LINK_DEPENDS "${scripts}")
  target_include_directories(${name} PRIVATE
    ${fw}/core ${fw}/app ${fw}/sensor ${fw}/emu ${fw}/port ${fw}/port/cortex_m ${ports} ${CMAKE_CURRENT_LIST_DIR})
  target_link_options(${name} PRIVATE ${cpu} -nostartfiles --specs=nano.specs -Wl,--gc-sections
    -Wl,--fatal-warnings -Wl,-Map=${name}.map -T ${port}/${linker} ${folders})
  board_compile_options(${ARGN})
  add_custom_command(TARGET ${name} POST_BUILD
    COMMAND ${CMAKE_OBJCOPY} -O binary -R .boot_vectors ${name}.elf ${name}.bin
    COMMAND ${Python3_EXECUTABLE} ${tools}/image/note.py ${name}.bin ${name}.elf --objcopy ${CMAKE_OBJCOPY}
    COMMAND ${CMAKE_OBJCOPY} -O ihex ${name}.elf ${name}.hex
    ${port_after} ${check})
endfunction()

function(gateway_image name port_name cpu linker)
  find_port("${port_name}")
  list(TRANSFORM ports APPEND /*.c OUTPUT_VARIABLE own)
  list(TRANSFORM ports APPEND /*/*.c OUTPUT_VARIABLE below)
  file(GLOB sources CONFIGURE_DEPENDS ${fw}/core/*.c ${fw}/core/*/*.c ${fw}/sensor/*.c ${fw}/app/*.c
    ${fw}/port/cortex_m/*.c ${own} ${below})
  board_image(${name} "${port_name}" ${cpu} ${linker} ${sources} ${ARGN})
endfunction()

function(emulated_image name image port_name cpu linker)
  find_port("${port_name}")
  file(GLOB sources CONFIGURE_DEPENDS ${fw}/sensor/*.c ${fw}/app/*.c ${fw}/emu/*.c ${fw}/../tests/target/semihosted.c
    ${port}/*.c)
  list(FILTER sources EXCLUDE REGEX "/port/${port_name}/(spi|flash)\\.c$")
  qemu_executable(${name} ${port_name} ${cpu} ${linker} "${sources}" ${ARGN})
  target_sources(${name} PRIVATE $<FILTER:$<TARGET_OBJECTS:${image}>,INCLUDE,/core/[a-z]*/?[a-z0-9_]*.c.obj>)
  target_link_options(${name} PRIVATE
    -Wl,--wrap=clock_us,--wrap=port_alarm_at,--wrap=port_delay_us,--wrap=bt_port_alarm,--wrap=port_idle
    -Wl,--wrap=port_identify)
endfunction()

# Any program in QEMU on a port: the port's start-up, and no limits.
function(qemu_executable name port_name cpu linker sources)
  find_port("${port_name}")
  file(GLOB shared CONFIGURE_DEPENDS ${fw}/port/cortex_m/*.c)
  leave_out_systick(shared)
  separate_arguments(cpu)
  add_executable(${name} ${sources} ${shared})
  set_target_properties(${name} PROPERTIES SUFFIX .elf LINK_DEPENDS ${port}/${linker})
  target_compile_options(${name} PRIVATE ${cpu})
  target_compile_definitions(${name} PRIVATE BOARD_NEVER_SLEEPS ${ARGN})
  target_include_directories(${name} PRIVATE ${fw}/core ${fw}/app ${fw}/sensor ${fw}/emu ${fw}/port ${fw}/port/cortex_m
    ${port} ${fw}/../tests/target ${CMAKE_CURRENT_LIST_DIR})
  target_link_options(${name} PRIVATE ${cpu} -nostartfiles --specs=nano.specs -Wl,--gc-sections -Wl,--fatal-warnings
    -T ${port}/${linker})
  board_compile_options(${sources} ${shared})
endfunction()
