#include "recon/photometry/baseline.h"

#include <fmt/format.h>

#include <cmath>
#include <set>

#include "common/config.h"
#include "common/files.h"

namespace lumen {

std::vector<BaselineInterval> ReadBaseline(const std::filesystem::path& file) {
  const Config config = Config::Read(file);
  const ConfigTable root = config.root();
  root.Choice("format", {"lumen-photometry-baseline"});
  if (root.Integer("version") != 1) root.Fail("version", "this program reads version 1 only");
  std::vector<BaselineInterval> baseline;
  std::set<std::string> names;
  for (const ConfigTable& entry : root.Tables("figure")) {
    const BaselineInterval interval = {entry.String("name"), entry.Number("low"), entry.Number("high")};
    if (interval.high < interval.low) entry.Fail("high", "is below low, so that no figure fits");
    if (!names.insert(interval.name).second) entry.Fail("name", "\"" + interval.name + "\" is here twice");
    baseline.push_back(interval);
  }
  if (baseline.empty()) root.Fail("figure", "names no figure, so that nothing would be compared");
  config.RejectUnknown();
  return baseline;
}

void WriteBaseline(const std::filesystem::path& file, const Photometry& photometry, double errors) {
  constexpr double kDecimals = 1e6;
  std::string text = "# Intervals of `lumen photometry --baseline`: values of a run ± " +
                     fmt::format("{:g}", errors) +
                     " standard errors.\n"
                     "# Figures that are left out here aren't compared.\n"
                     "format = \"lumen-photometry-baseline\"\nversion = 1\nfigure = [\n";
  for (const Figure& figure : photometry.figures) {
    const double half = errors * figure.standard_error;
    text += fmt::format("  {{name = \"{}\", low = {:.6f}, high = {:.6f}}},\n", figure.name,
                        std::floor((figure.value - half) * kDecimals) / kDecimals,
                        std::ceil((figure.value + half) * kDecimals) / kDecimals);
  }
  WriteFile(file, text + "]\n");
}

std::vector<std::string> CompareWithBaseline(const Photometry& photometry,
                                             const std::vector<BaselineInterval>& baseline) {
  std::vector<std::string> outside;
  for (const BaselineInterval& interval : baseline) {
    const Figure* figure = photometry.Find(interval.name);
    if (figure == nullptr) {
      outside.push_back(interval.name + ": the sequence gives no such figure");
    } else if (!(interval.low <= figure->value && figure->value <= interval.high)) {
      outside.push_back(fmt::format("{}: {:.6g} ± {:.2g} is outside [{:.6g}, {:.6g}]", interval.name,
                                    figure->value, figure->standard_error, interval.low, interval.high));
    }
  }
  return outside;
}

}  // namespace lumen
