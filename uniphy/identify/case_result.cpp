#include "uniphy/identify/case_result.hpp"

#include <array>
#include <utility>

#include "uniphy/inference/infer_run.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/observation.hpp"
#include "uniphy/io/seal.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-identified-case";
constexpr const char* kFile = "case.h5";

constexpr std::array<std::pair<const char*, std::string Identified::*>, 6> kTexts{
    {{"material", &Identified::material},
     {"shape", &Identified::shape},
     {"other_shape", &Identified::other_shape},
     {"named", &Identified::named},
     {"numbers", &Identified::numbers},
     {"truth", &Identified::truth}}};
constexpr std::array<std::pair<const char*, double Identified::*>, 11> kNumbers{
    {{"noise_over_size", &Identified::noise_share},
     {"fit_mse", &Identified::fit_mse},
     {"fit_root_over_size", &Identified::fit_share},
     {"found_mse", &Identified::found_mse},
     {"found_root_over_size", &Identified::found_share},
     {"probability", &Identified::probability},
     {"other_best_mse", &Identified::other_best},
     {"resim_mse", &Identified::resim_mse},
     {"resim_root_over_size", &Identified::resim_share},
     {"seconds", &Identified::wall_s},
     {"memory_mb", &Identified::memory_mb}}};

}  // namespace

void write_case_result(const std::filesystem::path& folder, const CaseResult& result,
                       const std::string& fingerprint) {
  hdf5::Writer writer(folder / kFile);
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", 3);
  writer.attribute("/", "fingerprint", fingerprint);
  for (const auto& [name, text] : kTexts) writer.attribute("/", name, result.row.*text);
  for (const auto& [name, number] : kNumbers) writer.attribute("/", name, result.row.*number);
  writer.attribute("/", "beats_other", result.row.beats_other ? 1 : 0);
  writer.attribute("/", "named_right", result.row.named_right ? 1 : 0);
  writer.attribute("/", "roll_outs", static_cast<std::int64_t>(result.row.roll_outs));
  const std::vector<double>& best = result.pictures.best;
  writer.write("best", best, {static_cast<std::int64_t>(best.size())},
               {"m^2", "best loss so far within each stage, over the roll-outs of the result"});
  writer.commit_sealed();
}

std::optional<CaseResult> read_case_result(const std::filesystem::path& folder,
                                           const std::string& fingerprint) {
  if (!std::filesystem::exists(folder / kFile)) return {};
  const hdf5::Reader reader(folder / kFile);
  if (reader.check_format(kFormat, 3) < 3) return {};
  if (reader.attribute_text("/", "fingerprint") != fingerprint) return {};
  check_seal(folder / kFile);
  CaseResult result;
  for (const auto& [name, text] : kTexts) result.row.*text = reader.attribute_text("/", name);
  for (const auto& [name, number] : kNumbers) result.row.*number = reader.attribute_real("/", name);
  result.row.beats_other = reader.attribute_integer("/", "beats_other") != 0;
  result.row.named_right = reader.attribute_integer("/", "named_right") != 0;
  result.row.roll_outs = static_cast<std::size_t>(reader.attribute_integer("/", "roll_outs"));
  CasePictures& pictures = result.pictures;
  pictures.material = result.row.material;
  pictures.best = reader.read<double>("best", {-1});
  pictures.observed = observed_trajectory(read_observation(folder / "observation.h5"));
  pictures.fitted = read_trajectory(folder / "fitted.h5");
  pictures.whole = read_trajectory(folder / "truth.h5");
  pictures.predicted = read_trajectory(folder / "resimulated.h5");
  pictures.truth = read_trajectory(folder / "other_truth.h5");
  return result;
}

void forget_case_result(const std::filesystem::path& folder) {
  std::error_code ignored;
  std::filesystem::remove(folder / kFile, ignored);
}

}  // namespace uniphy
