# Writes OUTPUT, which defines what uniphy/report/report_page.hpp declares. FILES: the page, its
# style, and the files of its script, in this order.
function(literal variable file)
  file(READ "${file}" text)
  set(${variable} "R\"page(${text})page\"" PARENT_SCOPE)
endfunction()

list(POP_FRONT FILES html style)
literal(html "${html}")
literal(style "${style}")
set(scripts "")
foreach(file IN LISTS FILES)
  literal(script "${file}")
  string(APPEND scripts "\n    ${script}")
endforeach()
file(WRITE "${OUTPUT}" "#include \"uniphy/report/report_page.hpp\"

namespace uniphy::page {

const char* const html = ${html};
const char* const style = ${style};
const char* const script =${scripts};

}  // namespace uniphy::page
")
