#include "common/line_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

#include "common/error.h"

namespace lumen {
namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";

// A word from a damaged file, fit to be shown in a message.
std::string Shown(std::string_view word) {
  constexpr size_t kMost = 40;
  std::string shown(word.substr(0, kMost));
  std::replace_if(
      shown.begin(), shown.end(), [](unsigned char c) { return c < 0x20 || c > 0x7e; }, '?');
  return "\"" + shown + (word.size() > kMost ? "…\"" : "\"");
}

// from_chars knows no leading plus.
std::string_view WithoutPlus(std::string_view word) {
  return word.size() > 1 && word[0] == '+' && word[1] != '-' ? word.substr(1) : word;
}

}  // namespace

bool LineReader::NextLine() {
  if (next_ >= text_.size()) return false;
  const size_t end = std::min(text_.find('\n', next_), text_.size());
  line_ = text_.substr(next_, end - next_);
  if (line_.ends_with('\r')) line_.remove_suffix(1);
  next_ = std::min(end + 1, text_.size());
  ++line_number_;
  return true;
}

bool LineReader::NextFilledLine() {
  while (NextLine()) {
    line_ = line_.substr(0, line_.find('#'));
    if (line_.find_first_not_of(kBlanks) != std::string_view::npos) return true;
  }
  return false;
}

std::string_view LineReader::Word() {
  const size_t begin = std::min(line_.find_first_not_of(kBlanks), line_.size());
  const size_t end = std::min(line_.find_first_of(kBlanks, begin), line_.size());
  const std::string_view word = line_.substr(begin, end - begin);
  line_.remove_prefix(end);
  return word;
}

double LineReader::Number(std::string_view what) { return ToNumber(Word(), what); }

int64_t LineReader::Integer(std::string_view what) { return ToInteger(Word(), what); }

double LineReader::ToNumber(std::string_view word, std::string_view what) const {
  if (word.empty()) Fail("the line ends where " + std::string(what) + " should be");
  const std::string_view digits = WithoutPlus(word);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc::invalid_argument || end != digits.data() + digits.size()) {
    Fail(std::string(what) + " is " + Shown(word) + ", which is no number");
  }
  // Too large or too small; only strtod says which, by infinity or 0.
  if (error == std::errc::result_out_of_range) value = std::strtod(std::string(digits).c_str(), nullptr);
  if (!std::isfinite(value)) Fail(std::string(what) + " is " + Shown(word) + ", but must be finite");
  return value;
}

int64_t LineReader::ToInteger(std::string_view word, std::string_view what) const {
  if (word.empty()) Fail("the line ends where " + std::string(what) + " should be");
  const std::string_view digits = WithoutPlus(word);
  int64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size()) {
    Fail(std::string(what) + " is " + Shown(word) + ", which is no integer");
  }
  return value;
}

void LineReader::FailAt(int line_number, const std::string& problem) const {
  throw InputError(file_ + ":" + std::to_string(std::max(line_number, 1)) + ": " + problem);
}

void AppendNumber(std::string* text, double value) {
  char digits[32];
  text->append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

}  // namespace lumen
