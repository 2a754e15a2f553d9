#include "common/files.h"

#include <fstream>

#include "common/error.h"
#include "tests/support.h"

namespace lumen {
namespace {

size_t EntriesOf(const std::filesystem::path& folder) {
  return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(Files, BytesComeBack) {
  const test::ScratchFolder scratch;
  std::string bytes(100000, '\0');
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 31);
  WriteFile(scratch / "a.bin", bytes);
  EXPECT_EQ(ReadFile(scratch / "a.bin"), bytes);
  WriteFile(scratch / "a.bin", "");
  EXPECT_EQ(ReadFile(scratch / "a.bin"), "");
  EXPECT_EQ(EntriesOf(scratch.path()), 1u);
}

TEST(Files, WhatIsNotCommittedLeavesTheTargetAndNothingElse) {
  const test::ScratchFolder scratch;
  WriteFile(scratch / "a.txt", "old");
  {
    const PendingFile pending(scratch / "a.txt");
    EXPECT_EQ(pending.path().extension(), ".txt");
    EXPECT_NE(pending.path(), scratch / "a.txt");
    std::ofstream(pending.path()) << "half of the ne";
    EXPECT_EQ(ReadFile(scratch / "a.txt"), "old");
  }
  EXPECT_EQ(ReadFile(scratch / "a.txt"), "old");
  EXPECT_EQ(EntriesOf(scratch.path()), 1u);
}

TEST(Files, TwoPendingFilesOfOneTargetDoNotMeet) {
  const test::ScratchFolder scratch;
  const PendingFile a(scratch / "x.ply"), b(scratch / "x.ply");
  EXPECT_NE(a.path(), b.path());
}

TEST(Files, CommitReplacesWhatALinkPointsTo) {
  const test::ScratchFolder scratch;
  WriteFile(scratch / "a.txt", "old");
  std::filesystem::create_symlink("a.txt", scratch / "link.txt");
  WriteFile(scratch / "link.txt", "new");
  EXPECT_TRUE(std::filesystem::is_symlink(scratch / "link.txt"));
  EXPECT_EQ(ReadFile(scratch / "a.txt"), "new");
}

TEST(Files, DevicesAreWrittenInPlace) {
  WriteFile("/dev/null", "nothing");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST(Files, ErrorsNameFileAndReason) {
  const test::ScratchFolder scratch;
  try {
    WriteFile(scratch / "none/a.txt", "x");
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_EQ(error.what(), (scratch / "none/a.txt").string() + ": cannot write: No such file or directory");
  }
  try {
    ReadFile(scratch.path());
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_EQ(error.what(), scratch.path().string() + ": cannot read: Is a directory");
  }
  WriteFile(scratch / "file", "x");
  EXPECT_THROW(CreateFolder(scratch / "file/sub"), InputError);
  EXPECT_THROW(CreateFolder(scratch / "file"), InputError);
  EXPECT_THROW(WriteFile(scratch.path(), "x"), InputError);
  EXPECT_THROW(WriteFile("/dev/full", "x"), InputError);
  CreateFolder(scratch / "a/b/c");
  EXPECT_TRUE(std::filesystem::is_directory(scratch / "a/b/c"));
}

}  // namespace
}  // namespace lumen
