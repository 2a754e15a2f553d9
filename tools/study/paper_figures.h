// What the paper reports.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "recon/evaluation/evaluate.h"

namespace lumen {

struct PaperFigures {
  std::string sequence;  // C3VD's name
  std::string label;     // the paper's: "C1a"
  ErrorFigures surveyed, extended;
};

// Table 1 of Batlle, Montiel, Fua, Tardós, "LightNeuS: Neural Surface Reconstruction in Endoscopy using
// Illumination Decline", MICCAI 2023: LightNeuS on C3VD's 22 sequences, mm.
const std::vector<PaperFigures>& PaperTable();

// The same table's figures for NeuS, which it has for two sequences.
const std::vector<PaperFigures>& PaperTableOfNeus();

// The row of a sequence; null where the table has none.
const PaperFigures* FindPaperFigures(const std::vector<PaperFigures>& table, const std::string& sequence);

}  // namespace lumen
