# uniphy_embed(<target> <output.cpp> HTML <file> STYLE <file> SCRIPT <files>...)
# Makes a source of <target> of text files, so that a program needs none of them when it runs.
function(uniphy_embed target output)
  cmake_parse_arguments(arg "" "HTML;STYLE" "SCRIPT" ${ARGN})
  set(files ${arg_HTML} ${arg_STYLE} ${arg_SCRIPT})
  list(TRANSFORM files PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
  set(script "${PROJECT_SOURCE_DIR}/.cmake/embed_page.cmake")
  add_custom_command(
    OUTPUT "${CMAKE_CURRENT_BINARY_DIR}/${output}"
    COMMAND ${CMAKE_COMMAND} "-DOUTPUT=${CMAKE_CURRENT_BINARY_DIR}/${output}"
            "-DFILES=${files}" -P "${script}"
    DEPENDS ${files} "${script}"
    VERBATIM)
  target_sources(${target} PRIVATE "${CMAKE_CURRENT_BINARY_DIR}/${output}")
endfunction()
