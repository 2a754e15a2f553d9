// Stored intervals that a sequence's photometric figures must stay in.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "recon/photometry/photometry.h"

namespace lumen {

struct BaselineInterval {
  std::string name;
  double low = 0, high = 0;
};

// Reads
//   format = "lumen-photometry-baseline"
//   version = 1
//   figure = [
//     {name = "t_exponent", low = -2.01, high = -1.99},
//     …
//   ]
// Throws InputError with file, line and key: a missing or unknown key, high below low, a name twice, none at
// all.
std::vector<BaselineInterval> ReadBaseline(const std::filesystem::path& file);

// Every figure ± `errors` standard errors, outwards to the sixth decimal. Throws InputError.
void WriteBaseline(const std::filesystem::path& file, const Photometry& photometry, double errors);

// One line for each interval that its figure isn't in, or whose figure the run doesn't have. Figures without
// an interval aren't asked for.
std::vector<std::string> CompareWithBaseline(const Photometry& photometry,
                                             const std::vector<BaselineInterval>& baseline);

}  // namespace lumen
