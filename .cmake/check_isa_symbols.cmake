# cmake -DNM=<nm> -DISA=<avx2|avx512> "-DOBJECTS=<a.o;b.o>" -P check_isa_symbols.cmake
#
# Fails when an object compiled for an optional instruction set defines a symbol that the linker
# could merge with, or hand to, code meant for any CPU: a std:: or other inline function emitted
# weakly there would crash CPUs without that instruction set, only on some machines and only for
# some link orders. Every symbol must carry the instruction set in its name: our namespace isa_<ISA>
# or one of xsimd's architecture tags.
if(ISA STREQUAL "avx512")
  set(own_tags "isa_avx512|xsimd::avx512")
elseif(ISA STREQUAL "avx2")
  set(own_tags "isa_avx2|xsimd::avx2|xsimd::fma3<xsimd::avx")
else()
  message(FATAL_ERROR "unknown ISA '${ISA}', expected avx2 or avx512")
endif()

set(defined 0)
set(foreign "")
foreach(object IN LISTS OBJECTS)
  execute_process(COMMAND "${NM}" --demangle --defined-only --extern-only "${object}"
                  OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
  string(REPLACE ";" "," symbols "${symbols}")
  string(REPLACE "[" "(" symbols "${symbols}")
  string(REPLACE "]" ")" symbols "${symbols}")
  string(REPLACE "\n" ";" symbols "${symbols}")
  foreach(line IN LISTS symbols)
    if(line STREQUAL "" OR line MATCHES "DW\\.ref\\.")
      continue()  # DW.ref.*: the compiler's pointer to the exception personality, data only
    endif()
    math(EXPR defined "${defined} + 1")
    if(NOT line MATCHES "${own_tags}")
      string(APPEND foreign "\n  ${line}")
    endif()
  endforeach()
endforeach()

if(defined EQUAL 0)
  message(FATAL_ERROR "no symbols found in '${OBJECTS}': nothing was checked")
endif()
if(foreign)
  message(FATAL_ERROR "${ISA} objects define symbols that do not name it:${foreign}")
endif()
message(STATUS "${defined} external symbols, all of them named for ${ISA}")
