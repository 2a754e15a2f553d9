// One line on a terminal that says how far a job is and how long it will take. Silent when stderr is no
// terminal.
#pragma once

#include <chrono>
#include <mutex>
#include <string>

namespace lumen {

// Turns all progress lines off (--quiet).
void SetQuiet(bool quiet);

// A line for people on stderr, in quiet runs suppressed; results go to stdout.
void Say(const std::string& line);

class Progress {
 public:
  // `what` names the job: "render", "train", …
  explicit Progress(std::string what);
  ~Progress();  // clears the line

  // done in [0, 1]; note is shown behind the time left ("loss 0.0123"). May be called from any thread, as
  // often as one likes: it redraws ten times a second at most.
  void Update(double done, const std::string& note = "");

 private:
  std::string what_;
  bool shown_;
  std::chrono::steady_clock::time_point start_, drawn_;
  double first_done_ = -1;  // of the first Update
  std::mutex mutex_;
};

}  // namespace lumen
