#pragma once

namespace uniphy::models {

/// The files models/script/law.py, isotropic.py and published.py, put into the library by the
/// build: nothing is read where a law is exported.
extern const char* const kLawScript;
extern const char* const kIsotropicScript;
extern const char* const kPublishedScript;

}  // namespace uniphy::models
