# The libraries of board images, the simulator, the Python extension and the tests. biotac_options, an interface library
# of compile options, must exist before this is included.
set(fw ${CMAKE_CURRENT_LIST_DIR})

# Pure integer C: the same files on every board, in the simulator and under the Python tests.
file(GLOB core CONFIGURE_DEPENDS ${fw}/core/*.c ${fw}/core/*/*.c)
add_library(biotac_core STATIC ${core})
target_include_directories(biotac_core PUBLIC ${fw}/core)

# The same maths in double, from the papers. Never linked into a board image.
add_library(biotac_reference STATIC ${fw}/reference/lin2013.c ${fw}/reference/exact.c
  ${fw}/reference/grip_parts.c)
target_include_directories(biotac_reference PUBLIC ${fw}/reference ${fw}/core)
target_link_libraries(biotac_reference PUBLIC biotac_core m)

# The SPI driver, over port.h.
add_library(biotac_sensor STATIC
  ${fw}/sensor/properties.c ${fw}/sensor/sampler.c ${fw}/sensor/word.c)
target_include_directories(biotac_sensor PUBLIC ${fw}/sensor ${fw}/port)
target_link_libraries(biotac_sensor PUBLIC biotac_core)

# The emulated sensor, as the bus sees it.
add_library(biotac_emu STATIC ${fw}/emu/bus.c ${fw}/emu/device.c ${fw}/emu/stream.c
  ${fw}/emu/by_clock.c)
target_include_directories(biotac_emu PUBLIC ${fw}/emu)
target_link_libraries(biotac_emu PUBLIC biotac_core)

# The app without main.c, for a program with a port of its own.
set(gateway ${fw}/app/gateway.c ${fw}/app/kept_tares.c ${fw}/app/start.c ${fw}/app/uart.c)

foreach(lib biotac_core biotac_reference biotac_sensor biotac_emu)
  if(NOT CMAKE_SYSTEM_NAME STREQUAL "Generic") # a board's image
    set_target_properties(${lib} PROPERTIES POSITION_INDEPENDENT_CODE ON) # they go into Python's extension
  endif()
  target_link_libraries(${lib} PUBLIC biotac_options)
endforeach()
