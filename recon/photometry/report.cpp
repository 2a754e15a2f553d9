#include "recon/photometry/report.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace lumen {
namespace {

std::string Value(const Figure* figure) {
  if (figure == nullptr) return fmt::format("{:>13}{:8}", "-", "");
  return fmt::format("{:>10.5f} ± {:<8.5f}", figure->value, figure->standard_error);
}

std::string Percent(double part, double whole) {
  return whole > 0 ? fmt::format("{:.1f}%", 100 * part / whole) : "-";
}

// Columns are padded, lines needn't end in it.
std::string EndLine(std::string line) {
  line.erase(line.find_last_not_of(' ') + 1);
  return line + "\n";
}

std::string ModelRows(const Photometry& photometry) {
  std::string head = fmt::format("{:<16}{:>9}{:>21}", "figure", "expected", "all channels    ");
  for (int channel : photometry.channels) {
    head += fmt::format("{:>21}", std::string(ChannelName(channel)) + "       ");
  }
  std::string table = EndLine(head);
  for (const char* name :
       {"t_exponent", "cos_exponent", "spread", "gamma", "gamma_from_gains", "r_squared", "residual"}) {
    const Figure* figure = photometry.Find(name);
    if (figure == nullptr) continue;
    std::string row =
        fmt::format("{:<16}", name) +
        (figure->expected ? fmt::format("{:>9.4f}", *figure->expected) : fmt::format("{:>9}", "")) +
        Value(figure);
    for (int channel : photometry.channels) {
      if (std::string(name).starts_with("gamma")) break;  // of all channels only
      row += Value(photometry.Find(std::string(ChannelName(channel)) + "." + name));
    }
    table += EndLine(row);
  }
  return table + fmt::format("{:<16}{:>9}{:>10.5f}\n", "without light", "", photometry.all.scatter);
}

// Gains in one line; JSON has them all.
std::string GainRow(const Photometry& photometry) {
  double squares = 0, worst = 0;
  int worst_frame = -1;
  bool expected = false;
  const Figure* worst_figure = nullptr;
  for (int number : photometry.frame_numbers) {
    const Figure* figure = photometry.Find(GainFigureName(number));
    if (figure == nullptr) continue;
    expected = expected || figure->expected;
    const double difference = figure->value - figure->expected.value_or(0);
    squares += difference * difference;
    if (std::abs(difference) >= worst) {
      worst = std::abs(difference);
      worst_frame = number;
      worst_figure = figure;
    }
  }
  if (worst_figure == nullptr) return "";
  return fmt::format("log gain        {} by {:.5f} in the mean (RMS), most in frame {}: {:+.5f} ± {:.5f}\n",
                     expected ? "off the sequence's own" : "varies",
                     std::sqrt(squares / photometry.frame_numbers.size()), worst_frame,
                     worst_figure->value - worst_figure->expected.value_or(0), worst_figure->standard_error);
}

std::string BinRows(const std::string& title, const std::vector<Bin>& bins, int64_t count) {
  std::string table = fmt::format("{:<16}{:>9}{:>21}{:>10}\n", title, "pixels", "mean residual   ", "RMS");
  for (const Bin& bin : bins) {
    table += fmt::format("{:<16}{:>9}{:>+10.5f} ± {:<8.5f}{:>10.5f}\n",
                         fmt::format("  {:g}-{:g}", bin.from, bin.to), Percent(bin.count, count), bin.mean,
                         bin.standard_error, bin.rms);
  }
  return table;
}

nlohmann::json BinsJson(const std::vector<Bin>& bins) {
  nlohmann::json json = nlohmann::json::array();
  for (const Bin& bin : bins) {
    json.push_back({{"from", bin.from},
                    {"to", bin.to},
                    {"count", bin.count},
                    {"mean", bin.mean},
                    {"standard_error", bin.standard_error},
                    {"rms", bin.rms}});
  }
  return json;
}

nlohmann::json FigureJson(const Figure& figure) {
  nlohmann::json json = {{"value", figure.value}, {"standard_error", figure.standard_error}};
  if (figure.expected) json["expected"] = *figure.expected;
  return json;
}

}  // namespace

std::string ToTable(const Photometry& photometry, const Observations& observations) {
  const double taken = static_cast<double>(observations.taken);
  std::string table = fmt::format("{} frames, {} pixels at {} places", observations.frames.size(),
                                  observations.size(), observations.cells());
  if (!photometry.left_out.empty()) table += fmt::format(", {} frames left out", photometry.left_out.size());
  table += fmt::format(
      "\nleft out: no surface {}, edges {}, grazing {}; saturated {} / {} / {}, dark {} / {} / {}\n",
      Percent(observations.no_surface, taken), Percent(observations.edges, taken),
      Percent(observations.grazing, taken), Percent(observations.saturated[0], taken),
      Percent(observations.saturated[1], taken), Percent(observations.saturated[2], taken),
      Percent(observations.dark[0], taken), Percent(observations.dark[1], taken),
      Percent(observations.dark[2], taken));
  return table + ModelRows(photometry) + GainRow(photometry) +
         BinRows("distance, mm", photometry.by_distance, photometry.all.count) +
         BinRows("incidence, deg", photometry.by_angle, photometry.all.count);
}

nlohmann::json ToJson(const Photometry& photometry, const Observations& observations) {
  nlohmann::json figures = nlohmann::json::object();
  for (const Figure& figure : photometry.figures) figures[figure.name] = FigureJson(figure);
  return {{"frames", photometry.frame_numbers},
          {"frames_left_out", photometry.left_out},
          {"places", observations.cells()},
          {"pixels",
           {{"taken", observations.taken},
            {"used", observations.size()},
            {"no_surface", observations.no_surface},
            {"edges", observations.edges},
            {"grazing", observations.grazing},
            {"saturated", observations.saturated},
            {"dark", observations.dark}}},
          {"observations", photometry.all.count},
          {"scatter_without_light", photometry.all.scatter},
          {"figures", figures},
          {"residual_by_distance_mm", BinsJson(photometry.by_distance)},
          {"residual_by_angle_deg", BinsJson(photometry.by_angle)}};
}

}  // namespace lumen
