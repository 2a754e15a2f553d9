#include "tools/exchange/npz.h"

#include <boost/crc.hpp>
#include <cstdint>

#include "common/error.h"
#include "common/files.h"

namespace lumen {
namespace {

// ZIP's fields are little endian.
void AppendField(std::string* bytes, uint64_t value, int size) {
  for (int i = 0; i < size; ++i) *bytes += static_cast<char>(value >> (8 * i) & 0xff);
}

std::string Npy(const Eigen::Matrix4d& matrix) {
  std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': (4, 4), }";
  // The data starts at a multiple of 64 bytes.
  constexpr size_t kBefore = 10;
  while ((kBefore + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  AppendField(&bytes, header.size(), 2);
  bytes += header;
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = matrix;
  bytes.append(reinterpret_cast<const char*>(rows.data()), 16 * sizeof(double));
  return bytes;
}

// What a member's own header and the directory at the archive's end have in common: version 2.0, no flags,
// stored, the oldest date there is (1980-01-01), sizes, name.
std::string CommonFields(const std::string& name, const std::string& content) {
  boost::crc_32_type crc;
  crc.process_bytes(content.data(), content.size());
  std::string bytes;
  AppendField(&bytes, 20, 2);
  AppendField(&bytes, 0, 2);
  AppendField(&bytes, 0, 2);
  AppendField(&bytes, 0, 2);
  AppendField(&bytes, 1 << 5 | 1, 2);
  AppendField(&bytes, crc.checksum(), 4);
  AppendField(&bytes, content.size(), 4);
  AppendField(&bytes, content.size(), 4);
  AppendField(&bytes, name.size(), 2);
  AppendField(&bytes, 0, 2);
  return bytes;
}

}  // namespace

void WriteNpz(const std::filesystem::path& file, const std::vector<NamedMatrix>& matrices) {
  constexpr size_t kMost = 0xffff;  // of entries, without ZIP64
  if (matrices.size() > kMost) throw InputError(file.string() + ": more matrices than an archive can hold");
  std::string archive, directory;
  for (const auto& [matrix_name, matrix] : matrices) {
    const std::string name = matrix_name + ".npy", content = Npy(matrix);
    const std::string common = CommonFields(name, content);
    directory += "PK\x01\x02";
    AppendField(&directory, 20, 2);
    directory += common;
    AppendField(&directory, 0, 6);  // comment, disk, internal attributes
    AppendField(&directory, 0, 4);  // external attributes
    AppendField(&directory, archive.size(), 4);
    directory += name;
    archive += "PK\x03\x04" + common + name + content;
  }
  const size_t directory_at = archive.size();
  archive += directory + "PK\x05\x06";
  AppendField(&archive, 0, 2 + 2);  // disks
  AppendField(&archive, matrices.size(), 2);
  AppendField(&archive, matrices.size(), 2);
  AppendField(&archive, directory.size(), 4);
  AppendField(&archive, directory_at, 4);
  AppendField(&archive, 0, 2);  // comment
  WriteFile(file, archive);
}

}  // namespace lumen
