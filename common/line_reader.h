// Text files read line by line and word by word, so that every mistake has its line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace lumen {

class LineReader {
 public:
  // The text is referred to, not copied; `file` stands in messages.
  LineReader(const std::filesystem::path& file, std::string_view text) : file_(file.string()), text_(text) {}

  // Goes to the next line; false at the end of the text. Line ends are \n or \r\n.
  bool NextLine();
  // Goes to the next line that holds anything before a '#'; false at the end of the text.
  bool NextFilledLine();

  // Next word of the line, between blanks; empty at the line's end.
  std::string_view Word();
  // The next word as a finite number or an integer. Throws InputError; `what` names it in the message.
  double Number(std::string_view what);
  int64_t Integer(std::string_view what);

  // A word as a number or an integer.
  double ToNumber(std::string_view word, std::string_view what) const;
  int64_t ToInteger(std::string_view word, std::string_view what) const;

  // What is left of the line.
  std::string_view rest() const { return line_; }
  int line_number() const { return line_number_; }
  // Bytes up to the end of the current line, its end included.
  size_t offset() const { return next_; }

  // Throws InputError "FILE:LINE: problem".
  [[noreturn]] void Fail(const std::string& problem) const { FailAt(line_number_, problem); }
  [[noreturn]] void FailAt(int line_number, const std::string& problem) const;

 private:
  std::string file_;
  std::string_view text_;
  std::string_view line_;
  size_t next_ = 0;
  int line_number_ = 0;
};

// Appends the shortest decimal notation that reads back as the same number.
void AppendNumber(std::string* text, double value);

}  // namespace lumen
