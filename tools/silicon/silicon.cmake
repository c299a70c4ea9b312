# Ports on models of their chips' rules (registers.h), at the chips' addresses: needs GCC, and memory below 4 GiB. What
# tests/CMakeLists.txt includes.
#   silicon_test(CHIP BOARD SHARED FILES...)   tests/silicon/test_SHARED.c, with these files of firmware/port/SHARED or, in
#                                              a chip's own folder beside it, CHIP; SHARED is CHIP where there is no other
if(NOT BIOTAC_SANITIZE AND CMAKE_C_COMPILER_ID STREQUAL "GNU")
  function(silicon_test chip board shared)
    set(ports ${repository}/firmware/port/${shared} ${repository}/firmware/port/${chip})
    set(model ${repository}/tools/silicon)
    list(TRANSFORM ARGN PREPEND ${repository}/firmware/port/${shared}/ OUTPUT_VARIABLE ported)
    file(GLOB rules ${model}/${shared}_rules.c ${model}/${chip}_rules.c)
    file(GLOB facts ${model}/${chip}_facts.h)
    list(TRANSFORM facts PREPEND "SHELL:-include ")
    add_library(ported_${chip} OBJECT ${ported} silicon/test_${shared}.c core/main.c ${model}/${shared}_rest.c)
    target_include_directories(ported_${chip} PRIVATE core ${model} ${ports} ${repository}/firmware/port
      ${repository}/firmware/port/cortex_m ${repository}/firmware/boards/${board} ${repository}/firmware/boards/pico ${repository}/firmware/core
      ${repository}/firmware/app)
    target_compile_definitions(ported_${chip} PRIVATE ON_${chip})
    target_compile_options(ported_${chip} PRIVATE -fno-pie -O1 -g -include asm_seen.h -fsanitize=thread
      --param=tsan-distinguish-volatile=1 -Wno-uninitialized -Wno-pointer-to-int-cast -Wno-int-to-pointer-cast)
    target_link_libraries(ported_${chip} PRIVATE cmocka)
    add_executable(test_${chip} $<TARGET_OBJECTS:ported_${chip}> ${model}/registers.c ${rules})
    target_compile_options(test_${chip} PRIVATE -fno-pie ${facts})
    target_link_options(test_${chip} PRIVATE -no-pie)
    target_include_directories(test_${chip} PRIVATE ${model})
    target_link_libraries(test_${chip} PRIVATE biotac_core biotac_options cmocka)
    add_test(NAME test_${chip} COMMAND test_${chip})
  endfunction()
  set(rp2_files system.c timer.c spi.c slot.c uart.c link.c facts.c port_rp2.c usb/buffers.c usb/control.c
    usb/controller.c usb/data.c usb/descriptors.c)
  silicon_test(rp2040 pico rp2 ${rp2_files})
  silicon_test(rp2350 pico2 rp2 ${rp2_files} flash.c)
  silicon_test(stm32f405 f405 stm32f405 clocks.c flash.c port_stm32f405.c spi.c uart.c)
endif()
