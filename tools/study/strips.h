// Pictures of a table: what each sequence shows and where its reconstruction is wrong.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/mesh.h"
#include "common/sequence.h"
#include "recon/evaluation/evaluate.h"

namespace lumen {

// The middle frame beside the reconstruction as seen from there, coloured by its error, in one picture.
// rendered: the sequence whose frames have files; evaluation: of the reconstruction.
void WriteStrip(const Evaluation& evaluation, const Mesh& reconstruction, const Sequence& rendered,
                const std::filesystem::path& file);

struct TitledStrip {
  std::string title;
  std::filesystem::path file;
};

// All of them on a page, each under its title.
void WriteStripSheet(const std::vector<TitledStrip>& strips, const std::filesystem::path& file);

}  // namespace lumen
