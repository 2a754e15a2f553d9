#include "tools/study/table_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tools/study/paper_figures.h"

namespace lumen {
namespace {

using Figures = std::optional<ErrorFigures>;

// What is printed in a line: a sequence's figures or means.
struct Line {
  std::string name, label;
  Figures surveyed, extended, paper_surveyed, paper_extended;
};

const std::vector<PaperFigures>& PaperTableFor(const std::string& preset) {
  return preset.starts_with("neus") ? PaperTableOfNeus() : PaperTable();
}

Line LineOf(const TableRow& row, const std::string& preset) {
  Line line{row.name, "", row.surveyed, row.extended, {}, {}};
  if (const PaperFigures* paper = FindPaperFigures(PaperTableFor(preset), row.name)) {
    line.label = paper->label;
    line.paper_surveyed = paper->surveyed;
    line.paper_extended = paper->extended;
  }
  return line;
}

// Of those that have figures; nothing where none has.
Figures Mean(const std::vector<Line>& lines, Figures Line::*member) {
  ErrorFigures sum;
  int count = 0;
  for (const Line& line : lines) {
    if (const Figures& figures = line.*member) {
      sum.medae_mm += figures->medae_mm;
      sum.mae_mm += figures->mae_mm;
      sum.rmse_mm += figures->rmse_mm;
      ++count;
    }
  }
  if (count == 0) return std::nullopt;
  return ErrorFigures{sum.medae_mm / count, sum.mae_mm / count, sum.rmse_mm / count};
}

// The lines of one kind and, below them, their means.
struct Block {
  std::vector<const TableRow*> rows;
  std::vector<Line> lines;
  Line mean;
};

Block BlockOf(const Table& table, bool is_short) {
  Block block;
  for (const TableRow& row : table.rows) {
    if (IsShort(row) != is_short) continue;
    block.rows.push_back(&row);
    block.lines.push_back(LineOf(row, table.preset));
  }
  block.mean.name = fmt::format("mean of {}{}", block.rows.size(), is_short ? " (< 1 cm)" : "");
  for (const auto member : {&Line::surveyed, &Line::extended, &Line::paper_surveyed, &Line::paper_extended}) {
    block.mean.*member = Mean(block.lines, member);
  }
  return block;
}

std::vector<Block> BlocksOf(const Table& table) {
  std::vector<Block> blocks;
  for (const bool is_short : {false, true}) {
    Block block = BlockOf(table, is_short);
    if (!block.rows.empty()) blocks.push_back(std::move(block));
  }
  return blocks;
}

bool Simulated(const Table& table) {
  return std::ranges::any_of(table.rows,
                             [](const TableRow& row) { return row.data != TableData::kSequence; });
}

bool HasStandIns(const Table& table) {
  return std::ranges::any_of(table.rows,
                             [](const TableRow& row) { return row.data == TableData::kTwinOfStandIn; });
}

// What the figures are of, a sentence a line.
std::vector<std::string> Notes(const Table& table) {
  std::vector<std::string> notes;
  if (Simulated(table)) {
    notes.push_back("ours: simulated twin of C3VD, level \"" + NameOf(table.level) + "\", preset \"" +
                    table.preset + "\"");
    notes.push_back("paper: LightNeuS, Table 1, on C3VD's real frames: NOT the same data, so no comparison");
  } else {
    notes.push_back("ours: the sequences given, preset \"" + table.preset + "\"");
    notes.push_back("paper: LightNeuS, Table 1, on C3VD's real frames, its frames and calibration");
  }
  if (HasStandIns(table)) {
    notes.push_back("*: the recorded trajectory is absent; a stand-in of its length and motion");
  }
  return notes;
}

std::string Three(const Figures& figures) {
  if (!figures) return fmt::format("{:>6}{:>7}{:>7}", "-", "-", "-");
  return fmt::format("{:>6.2f}{:>7.2f}{:>7.2f}", figures->medae_mm, figures->mae_mm, figures->rmse_mm);
}

std::string Percent(const std::optional<double>& share) {
  return share ? fmt::format("{:.1f}", 100 * *share) : "-";
}

std::string TextOf(const Line& line, const std::string& mark) {
  return fmt::format("{:<20}{:<4}|{} |{} |{} |{} |", line.name + mark, line.label, Three(line.surveyed),
                     Three(line.paper_surveyed), Three(line.extended), Three(line.paper_extended));
}

// "a,b,c"; empty fields where there is nothing.
std::string CsvOf(const Figures& figures) {
  if (!figures) return ",,";
  return fmt::format("{:.6g},{:.6g},{:.6g}", figures->medae_mm, figures->mae_mm, figures->rmse_mm);
}

std::string CsvOf(const std::optional<double>& value) { return value ? fmt::format("{:.6g}", *value) : ""; }

std::string CsvOf(const Line& line) {
  return CsvOf(line.surveyed) + "," + CsvOf(line.extended) + "," + CsvOf(line.paper_surveyed) + "," +
         CsvOf(line.paper_extended);
}

std::string LatexOf(const Figures& figures) {
  if (!figures) return "-- & -- & --";
  return fmt::format("{:.2f} & {:.2f} & {:.2f}", figures->medae_mm, figures->mae_mm, figures->rmse_mm);
}

std::string LatexOf(const Line& line) {
  return LatexOf(line.surveyed) + " & " + LatexOf(line.paper_surveyed) + " & " + LatexOf(line.extended) +
         " & " + LatexOf(line.paper_extended);
}

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '_' || c == '%' || c == '&' || c == '#') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

const char* NameOfData(TableData data) {
  switch (data) {
    case TableData::kTwin:
      return "twin";
    case TableData::kTwinOfStandIn:
      return "twin_of_stand_in";
    case TableData::kSequence:
      return "sequence";
  }
  return "";
}

nlohmann::json JsonOf(const Figures& figures) {
  if (!figures) return nullptr;
  return {{"medae_mm", figures->medae_mm}, {"mae_mm", figures->mae_mm}, {"rmse_mm", figures->rmse_mm}};
}

nlohmann::json JsonOf(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json();
}

nlohmann::json JsonOf(const Line& line) {
  return {{"surveyed", JsonOf(line.surveyed)},
          {"extended", JsonOf(line.extended)},
          {"paper_surveyed", JsonOf(line.paper_surveyed)},
          {"paper_extended", JsonOf(line.paper_extended)}};
}

}  // namespace

std::string ToText(const Table& table) {
  std::string text;
  for (const std::string& note : Notes(table)) text += note + "\n";
  text += "\n" + fmt::format("{:<24}|{:^21}|{:^21}|{:^21}|{:^21}|\n", "mm", "surveyed, ours",
                             "surveyed, paper's", "extended, ours", "extended, paper's");
  const std::string head = fmt::format("{:>6}{:>7}{:>7} |", "MedAE", "MAE", "RMSE");
  text += fmt::format("{:<24}|{}{}{}{}{:>8}{:>8}{:>7}{:>7}{:>7}\n", "", head, head, head, head, "path mm",
                      "span mm", "seen %", "claims", "s");
  for (const Block& block : BlocksOf(table)) {
    for (size_t i = 0; i < block.rows.size(); ++i) {
      const TableRow& row = *block.rows[i];
      text += TextOf(block.lines[i], row.data == TableData::kTwinOfStandIn ? "*" : "") +
              fmt::format("{:>8.1f}{:>8.1f}{:>7}{:>7}{:>7.0f}\n", row.path_mm, row.span_mm,
                          Percent(row.truth_share), Percent(row.reconstruction_share), row.seconds);
    }
    text += TextOf(block.mean, "") + "\n\n";
  }
  return text;
}

std::string ToCsv(const Table& table) {
  std::string csv;
  for (const std::string& note : Notes(table)) csv += "# " + note + "\n";
  csv += "sequence,label,data,level,preset,short,frames,path_mm,span_mm";
  for (const char* whose : {"", "paper_"}) {
    for (const char* region : {"surveyed", "extended"}) {
      for (const char* figure : {"medae", "mae", "rmse"}) {
        csv += fmt::format(",{}{}_{}_mm", whose, region, figure);
      }
    }
  }
  csv += ",surveyed_share,claimed_share,seconds\n";
  for (const Block& block : BlocksOf(table)) {
    for (size_t i = 0; i < block.rows.size(); ++i) {
      const TableRow& row = *block.rows[i];
      csv += fmt::format("{},{},{},{},{},{},{},{:.6g},{:.6g},", row.name, block.lines[i].label,
                         NameOfData(row.data), NameOf(table.level), table.preset, IsShort(row) ? 1 : 0,
                         row.frames, row.path_mm, row.span_mm) +
             CsvOf(block.lines[i]) +
             fmt::format(",{},{},{:.4g}\n", CsvOf(row.truth_share), CsvOf(row.reconstruction_share),
                         row.seconds);
    }
    csv += fmt::format("{},,,{},{},{},,,,", block.mean.name, NameOf(table.level), table.preset,
                       IsShort(*block.rows.front()) ? 1 : 0) +
           CsvOf(block.mean) + ",,,\n";
  }
  return csv;
}

std::string ToLatex(const Table& table) {
  std::string latex;
  for (const std::string& note : Notes(table)) latex += "% " + note + "\n";
  latex += "\\begin{tabular}{l*{12}{r}}\n\\hline\n";
  latex +=
      " & \\multicolumn{3}{c}{surveyed, ours} & \\multicolumn{3}{c}{surveyed, paper$^\\dagger$}"
      " & \\multicolumn{3}{c}{extended, ours} & \\multicolumn{3}{c}{extended, paper$^\\dagger$} \\\\\n";
  latex += "mm";
  for (int i = 0; i < 4; ++i) latex += " & MedAE & MAE & RMSE";
  latex += " \\\\\n\\hline\n";
  for (const Block& block : BlocksOf(table)) {
    for (size_t i = 0; i < block.lines.size(); ++i) {
      const bool stands_in = block.rows[i]->data == TableData::kTwinOfStandIn;
      const Line& line = block.lines[i];
      latex += Escaped(line.label.empty() ? line.name : line.label) + (stands_in ? "$^*$" : "") + " & " +
               LatexOf(line) + " \\\\\n";
    }
    std::string mean = Escaped(block.mean.name);
    if (const size_t less = mean.find('<'); less != std::string::npos) mean.replace(less, 1, "$<$");
    latex += "\\hline\n" + mean + " & " + LatexOf(block.mean) + " \\\\\n\\hline\n";
  }
  latex += "\\multicolumn{13}{l}{\\footnotesize $^\\dagger$ LightNeuS, Table 1: C3VD's real frames";
  latex += Simulated(table) ? ", not the same data.}\n" : ".}\n";
  return latex + "\\end{tabular}\n";
}

nlohmann::json ToJson(const Table& table) {
  nlohmann::json sequences = nlohmann::json::array(), means = nlohmann::json::array();
  for (const Block& block : BlocksOf(table)) {
    for (size_t i = 0; i < block.rows.size(); ++i) {
      const TableRow& row = *block.rows[i];
      nlohmann::json json = JsonOf(block.lines[i]);
      json.update({{"sequence", row.name},
                   {"data", NameOfData(row.data)},
                   {"frames", row.frames},
                   {"path_mm", row.path_mm},
                   {"span_mm", row.span_mm},
                   {"surveyed_share", JsonOf(row.truth_share)},
                   {"claimed_share", JsonOf(row.reconstruction_share)},
                   {"seconds", row.seconds}});
      sequences.push_back(json);
    }
    nlohmann::json json = JsonOf(block.mean);
    json.update({{"sequences", block.rows.size()}, {"short", IsShort(*block.rows.front())}});
    means.push_back(json);
  }
  return {
      {"level", NameOf(table.level)}, {"preset", table.preset}, {"sequences", sequences}, {"means", means}};
}

}  // namespace lumen
