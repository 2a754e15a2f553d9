#include "tools/sequence_arguments.h"

#include "common/progress.h"

namespace lumen {

void AddSequenceArguments(CLI::App* command, SequenceArguments* arguments, const std::string& name) {
  command->add_option(name, arguments->folder, "sequence folder, ours or C3VD's")->required();
  command->add_flag("--skip-damaged", arguments->skip_damaged,
                    "leave out, naming them, frames that are missing, damaged or without a good pose");
}

Sequence ReadSequence(const SequenceArguments& arguments, bool calibration) {
  Sequence sequence = ReadSequence(arguments.folder, {arguments.skip_damaged, calibration});
  if (arguments.skip_damaged) LeaveOutUnreadableFrames(&sequence);
  for (const std::string& line : sequence.left_out) Say(line);
  return sequence;
}

}  // namespace lumen
