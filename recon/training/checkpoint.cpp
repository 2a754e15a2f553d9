#include "recon/training/checkpoint.h"

#include <algorithm>
#include <cstring>

#include "common/files.h"
#include "common/progress.h"

namespace lumen {
namespace {

constexpr char kMagic[8] = {'l', 'u', 'm', 'e', 'n', 'c', 'k', '7'};

// Bytes of a checkpoint besides its arrays and settings: two dozen numbers. Room for all at once, for a
// string that grows step by step takes up to three times as much.
constexpr size_t kLargestRest = 1024;

// FNV-1a, 64 bits (Fowler, Noll, Vo).
uint64_t Checksum(std::string_view bytes) {
  uint64_t hash = 0xcbf29ce484222325ull;
  for (unsigned char byte : bytes) hash = (hash ^ byte) * 0x100000001b3ull;
  return hash;
}

class Writer {
 public:
  template <class T>
  void Value(const T& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  template <class Vector>
  void Array(const Vector& values) {
    Value(static_cast<uint64_t>(values.size()));
    bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  }
  std::string bytes;
};

class Reader {
 public:
  Reader(std::string_view bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}
  template <class T>
  void Value(T* value) {
    Copy(value, sizeof(T));
  }
  template <class Vector>
  void Array(Vector* values) {
    uint64_t size;
    Value(&size);
    if (size != values->size()) {
      throw InputError(name_ + ": the checkpoint is of another sequence; train into another folder");
    }
    Copy(values->data(), values->size() * sizeof((*values)[0]));
  }
  std::string Text() {
    uint64_t size;
    Value(&size);
    if (size > bytes_.size()) FailShort();
    std::string text(size, '\0');
    Copy(text.data(), size);
    return text;
  }

 private:
  [[noreturn]] void FailShort() const { throw DamagedCheckpoint(name_ + ": the checkpoint is cut short"); }
  void Copy(void* to, size_t size) {
    if (size > bytes_.size()) FailShort();
    std::copy_n(bytes_.data(), size, static_cast<char*>(to));  // which may be an empty array's: nowhere
    bytes_.remove_prefix(size);
  }
  std::string_view bytes_;
  std::string name_;
};

// One list for both directions, so that they can't differ.
template <class Archive, class State>
void Fields(Archive&& value, State& state) {
  value(state.iteration);
  value(state.seconds);
  value(state.start_photometric);
  value(state.mean_photometric);
  value(state.skipped_steps);
  value(state.first_skipped_step);
  value(state.log_sharpness);
}
template <class Archive, class State>
void Arrays(Archive&& array, State& state) {
  array(state.parameters);
  array(state.first);
  array(state.second);
  array(state.log_gain);
  array(state.log_gain_first);
  array(state.log_gain_second);
  array(state.surroundings);
  array(state.poses.values);
  array(state.poses.first);
  array(state.poses.second);
}

void Rename(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::error_code error;
  std::filesystem::rename(from, to, error);
  if (error) throw InputError(to.string() + ": cannot write: " + error.message());
}

}  // namespace

void WriteCheckpoint(const std::filesystem::path& file, const std::string& settings,
                     const TrainState& state) {
  Writer writer;
  size_t numbers = 0;
  Arrays([&](const auto& values) { numbers += values.size() * sizeof(values[0]); }, state);
  writer.bytes.reserve(numbers + settings.size() + kLargestRest);
  writer.bytes.append(kMagic, sizeof(kMagic));
  writer.Array(settings);
  Fields([&](const auto& value) { writer.Value(value); }, state);
  Arrays([&](const auto& values) { writer.Array(values); }, state);
  writer.Value(Checksum(writer.bytes));
  const std::filesystem::path next = file.string() + ".next";
  WriteFile(next, writer.bytes);
  // By a second name, so that there is a checkpoint at every moment. Where the file system has no such links,
  // a run that is killed between the two renames leaves the one before alone.
  const std::filesystem::path before = CheckpointBefore(file);
  std::error_code failed;
  std::filesystem::remove(before, failed);
  std::filesystem::create_hard_link(file, before, failed);
  if (failed) std::filesystem::rename(file, before, failed);  // fails too where there is none yet
  Rename(next, file);
}

std::filesystem::path CheckpointBefore(const std::filesystem::path& file) {
  return file.string() + ".before";
}

void ReadCheckpoint(const std::filesystem::path& file, const std::string& settings, TrainState* state) {
  const std::string bytes = ReadFile(file);
  const std::string name = file.string();
  if (bytes.size() < sizeof(kMagic) + sizeof(uint64_t) ||
      std::memcmp(bytes.data(), kMagic, sizeof(kMagic)) != 0) {
    throw DamagedCheckpoint(name + ": not a checkpoint of this version, or cut short");
  }
  const std::string_view content(bytes.data(), bytes.size() - sizeof(uint64_t));
  uint64_t checksum;
  std::memcpy(&checksum, bytes.data() + content.size(), sizeof(checksum));
  if (checksum != Checksum(content)) {
    throw DamagedCheckpoint(name + ": the checkpoint is damaged (its checksum is wrong)");
  }
  Reader reader(content.substr(sizeof(kMagic)), name);
  if (reader.Text() != settings) {
    throw InputError(name +
                     ": the checkpoint was made with other settings; train into another folder, or with the "
                     "settings in config.toml beside it");
  }
  Fields([&](auto& value) { reader.Value(&value); }, *state);
  Arrays([&](auto& values) { reader.Array(&values); }, *state);
}

bool ReadLatestCheckpoint(const std::filesystem::path& file, const std::string& settings, TrainState* state) {
  const std::filesystem::path before = CheckpointBefore(file);
  std::string wrong = file.string() + ": there is none";
  try {
    if (std::filesystem::exists(file)) {
      ReadCheckpoint(file, settings, state);
      return true;
    }
    if (!std::filesystem::exists(before)) return false;
  } catch (const DamagedCheckpoint& damage) {
    wrong = damage.what();
    if (!std::filesystem::exists(before))
      throw DamagedCheckpoint(wrong + "; train without --resume to start afresh");
  }
  try {
    ReadCheckpoint(before, settings, state);
  } catch (const DamagedCheckpoint&) {
    throw DamagedCheckpoint(wrong + ", and so is the one before it, " + before.filename().string() +
                            "; train without --resume to start afresh");
  }
  // In the damaged one's place, which would otherwise take this one's when the next is written.
  Rename(before, file);
  Say(wrong + "; going on from the one before it, iteration " + std::to_string(state->iteration));
  return true;
}

void RemoveCheckpoints(const std::filesystem::path& file) {
  std::error_code there_is_none;
  std::filesystem::remove(file, there_is_none);
  std::filesystem::remove(CheckpointBefore(file), there_is_none);
}

}  // namespace lumen
