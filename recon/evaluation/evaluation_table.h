// The evaluation for people.
#pragma once

#include <string>

#include "recon/evaluation/evaluate.h"

namespace lumen {

// A few lines of text, in mm: the paper's rows, completeness, coverage and what the mesh is. Figures that
// don't exist are dashes; where no frame sees the reconstruction the last line says what to look at.
std::string ToTable(const Evaluation& evaluation);

}  // namespace lumen
