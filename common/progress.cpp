#include "common/progress.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>

namespace lumen {
namespace {

std::atomic<bool> quiet = false;
// Guards the terminal's last line, which Say and every Progress share.
std::mutex terminal;
bool line_drawn = false;

constexpr char kClearLine[] = "\r\033[K";

void ClearLine() {
  if (line_drawn) std::fputs(kClearLine, stderr);
  line_drawn = false;
}

// "0:07", "12:34", "3:05:00".
std::string Clock(double seconds) {
  const long whole = static_cast<long>(std::min(seconds, 1e9) + 0.5);
  char text[32];
  if (whole < 3600) {
    std::snprintf(text, sizeof text, "%ld:%02ld", whole / 60, whole % 60);
  } else {
    std::snprintf(text, sizeof text, "%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
  }
  return text;
}

}  // namespace

void SetQuiet(bool value) { quiet = value; }

void Say(const std::string& line) {
  if (quiet) return;
  const std::lock_guard lock(terminal);
  ClearLine();
  std::fprintf(stderr, "%s\n", line.c_str());
}

Progress::Progress(std::string what)
    : what_(std::move(what)),
      shown_(!quiet && isatty(STDERR_FILENO)),
      start_(std::chrono::steady_clock::now()),
      drawn_(start_) {}

Progress::~Progress() {
  if (!shown_) return;
  const std::lock_guard lock(terminal);
  ClearLine();
}

void Progress::Update(double done, const std::string& note) {
  if (!shown_) return;
  const std::lock_guard lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  // A job that was resumed starts beyond 0; its speed is what it does from there on.
  if (first_done_ < 0) first_done_ = done;
  if (now - drawn_ < std::chrono::milliseconds(100)) return;
  drawn_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  std::string line = what_ + " " + std::to_string(static_cast<int>(100 * std::clamp(done, 0.0, 1.0))) + "%";
  if (done > first_done_) line += "  " + Clock(seconds * (1 - done) / (done - first_done_)) + " left";
  if (!note.empty()) line += "  " + note;
  const std::lock_guard terminal_lock(terminal);
  std::fprintf(stderr, "%s%s", kClearLine, line.c_str());
  std::fflush(stderr);
  line_drawn = true;
}

}  // namespace lumen
