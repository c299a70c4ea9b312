# Ports on models of their chips' rules (registers.h), at the chips' addresses: needs GCC, and memory below 4 GiB. What
# tests/CMakeLists.txt includes.
#   silicon_test(CHIP BOARD FILES...)   tests/silicon/test_CHIP.c, with these files of firmware/port/CHIP
if(NOT BIOTAC_SANITIZE AND CMAKE_C_COMPILER_ID STREQUAL "GNU")
  function(silicon_test chip board)
    set(port ${repository}/firmware/port/${chip})
    list(TRANSFORM ARGN PREPEND ${port}/ OUTPUT_VARIABLE ported)
    add_library(ported_${chip} OBJECT ${ported} silicon/test_${chip}.c ${repository}/tools/silicon/${chip}_rest.c)
    target_include_directories(ported_${chip} PRIVATE core ${repository}/tools/silicon ${port} ${repository}/firmware/port
      ${repository}/firmware/port/cortex_m ${repository}/firmware/boards/${board} ${repository}/firmware/core
      ${repository}/firmware/app)
    target_compile_options(ported_${chip} PRIVATE -fno-pie -O1 -g -include asm_seen.h -fsanitize=thread
      --param=tsan-distinguish-volatile=1 -Wno-uninitialized -Wno-pointer-to-int-cast -Wno-int-to-pointer-cast)
    target_link_libraries(ported_${chip} PRIVATE cmocka)
    add_executable(test_${chip} $<TARGET_OBJECTS:ported_${chip}> ${repository}/tools/silicon/registers.c
      ${repository}/tools/silicon/${chip}_rules.c)
    target_compile_options(test_${chip} PRIVATE -fno-pie)
    target_link_options(test_${chip} PRIVATE -no-pie)
    target_include_directories(test_${chip} PRIVATE ${repository}/tools/silicon)
    target_link_libraries(test_${chip} PRIVATE biotac_core biotac_options cmocka)
    add_test(NAME test_${chip} COMMAND test_${chip})
  endfunction()
  silicon_test(rp2040 pico system.c timer.c spi.c slot.c uart.c link.c facts.c port_rp2040.c usb/buffers.c usb/control.c
    usb/controller.c usb/data.c usb/descriptors.c)
  silicon_test(stm32f405 f405 clocks.c flash.c port_stm32f405.c spi.c uart.c)
endif()
