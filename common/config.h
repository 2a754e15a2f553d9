// Configuration in TOML, read so that every mistake is an error with file and line: an unknown key, a missing
// one, a value of the wrong type or out of range.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/math.h"

namespace lumen {

class ConfigDocument;

// Closed interval that a number must lie in.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};
inline constexpr Range kAny{};
inline constexpr Range kPositive{std::numeric_limits<double>::min(), std::numeric_limits<double>::max()};
inline constexpr Range kNotNegative{0, std::numeric_limits<double>::max()};
inline constexpr Range kFraction{0, 1};

// One table of a configuration file. Reading a key marks it as known. The overloads without a default throw
// InputError where the key is missing; all throw InputError where the value doesn't fit. An integer where a
// real number is expected is a real number. Not finite (TOML's nan, inf) is out of every range.
class ConfigTable {
 public:
  bool Has(std::string_view key) const;

  double Number(std::string_view key, Range range = kAny) const;
  double Number(std::string_view key, double otherwise, Range range = kAny) const;
  int64_t Integer(std::string_view key, Range range = kAny) const;
  int64_t Integer(std::string_view key, int64_t otherwise, Range range = kAny) const;
  bool Flag(std::string_view key, bool otherwise) const;
  std::string String(std::string_view key) const;
  std::string String(std::string_view key, const std::string& otherwise) const;
  // One of the given words.
  std::string Choice(std::string_view key, const std::vector<std::string>& choices) const;
  std::string Choice(std::string_view key, const std::string& otherwise,
                     const std::vector<std::string>& choices) const;
  // A path; a relative one counts from the folder of the file that names it, from the working folder where it
  // was set on the command line.
  std::filesystem::path Path(std::string_view key) const;
  // An array of numbers; size 0 = any length.
  std::vector<double> Numbers(std::string_view key, size_t size = 0, Range range = kAny) const;
  std::vector<std::string> Strings(std::string_view key) const;
  Vec3d Vector(std::string_view key, Range range = kAny) const;
  Vec3d Vector(std::string_view key, const Vec3d& otherwise, Range range = kAny) const;

  // A sub-table. Table() throws where it is missing; Optional() answers nothing, so that an effect that a
  // scene doesn't name isn't built. Tables() reads an array of tables, empty where it is missing.
  ConfigTable Table(std::string_view key) const;
  std::optional<ConfigTable> Optional(std::string_view key) const;
  std::vector<ConfigTable> Tables(std::string_view key) const;

  // Throws InputError "FILE:LINE: KEY: problem". For checks that only the caller can make.
  [[noreturn]] void Fail(std::string_view key, const std::string& problem) const;

 private:
  friend class Config;
  struct Node;
  explicit ConfigTable(std::shared_ptr<const Node> node);
  std::shared_ptr<const Node> node_;
};

// A configuration file with the command line's settings on top.
class Config {
 public:
  // settings: "path.to.key=value", the value in TOML's notation, a bare word being a string; an index into an
  // array of tables is a number ("light.source.0.spread=2").
  static Config Read(const std::filesystem::path& file, const std::vector<std::string>& settings = {});
  // The same of a file whose key `base` may name another, from its own folder, that holds what it doesn't
  // say itself: tables are joined, anything else (arrays of tables too) is replaced. Messages name the file
  // that a key stands in; its relative paths count from there. A base has no base of its own.
  static Config ReadWithBase(const std::filesystem::path& file,
                             const std::vector<std::string>& settings = {});
  // `name` stands for the file in messages; relative paths count from `folder`.
  static Config Parse(std::string_view text, const std::string& name,
                      const std::filesystem::path& folder = {},
                      const std::vector<std::string>& settings = {});

  ConfigTable root() const;
  // Throws InputError for the first key that nobody has asked for, with the nearest known key of that table
  // as a suggestion. Call it when everything has been read.
  void RejectUnknown() const;

 private:
  explicit Config(std::shared_ptr<ConfigDocument> document);
  std::shared_ptr<const ConfigTable::Node> root_;
};

}  // namespace lumen
