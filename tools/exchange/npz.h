// Matrices in NumPy's .npz: an uncompressed ZIP archive (PKWARE's APPNOTE 6.3, method 0) of .npy files
// (NumPy's format 1.0).
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace lumen {

using NamedMatrix = std::pair<std::string, Eigen::Matrix4d>;

// Each becomes name.npy, 4×4 float64, row by row. Whole or not at all, the same bytes for the same matrices.
// Throws InputError.
void WriteNpz(const std::filesystem::path& file, const std::vector<NamedMatrix>& matrices);

}  // namespace lumen
