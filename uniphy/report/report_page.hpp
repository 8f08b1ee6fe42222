#pragma once

// The files of uniphy/report/page as the build found them.

namespace uniphy::page {

extern const char* const html;    ///< page.html, with {{places}} to fill
extern const char* const style;   ///< page.css
extern const char* const script;  ///< the *.js, in the order of CMakeLists.txt

}  // namespace uniphy::page
