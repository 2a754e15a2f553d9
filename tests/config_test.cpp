#include "common/config.h"

#include "common/files.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::ErrorOf;

constexpr char kText[] = R"(title = "a test"
[camera]
width = 1350
a = [769.2, 0, -8e-4]
flip = true
[[light.source]]
spread = 2
[[light.source]]
spread = 3.5
direction = [0, 0, 1]
[files]
mesh = "data/mesh.ply"
names = ["one", "two"]
)";

Config Parsed(const std::vector<std::string>& settings = {}) {
  return Config::Parse(kText, "scene.toml", "/folder", settings);
}

TEST(Config, ReadsEveryKindOfValue) {
  const Config config = Parsed();
  const ConfigTable root = config.root();
  EXPECT_EQ(root.String("title"), "a test");
  const ConfigTable camera = root.Table("camera");
  EXPECT_EQ(camera.Integer("width"), 1350);
  EXPECT_EQ(camera.Number("width"), 1350.0);  // an integer is a real number
  EXPECT_EQ(camera.Numbers("a", 3), (std::vector<double>{769.2, 0, -8e-4}));
  EXPECT_TRUE(camera.Flag("flip", false));
  const auto sources = root.Table("light").Tables("source");
  ASSERT_EQ(sources.size(), 2u);
  EXPECT_EQ(sources[1].Number("spread"), 3.5);
  EXPECT_EQ(sources[0].Number("spread"), 2.0);
  EXPECT_EQ(sources[1].Vector("direction"), Vec3d(0, 0, 1));
  EXPECT_EQ(root.Table("files").Path("mesh"), "/folder/data/mesh.ply");
  EXPECT_EQ(root.Table("files").Strings("names"), (std::vector<std::string>{"one", "two"}));
  config.RejectUnknown();
}

TEST(Config, FallsBackToDefaults) {
  const ConfigTable root = Parsed().root();
  EXPECT_EQ(root.Number("none", 1.5), 1.5);
  EXPECT_EQ(root.Integer("none", 7), 7);
  EXPECT_EQ(root.String("none", "x"), "x");
  EXPECT_EQ(root.Choice("none", "b", {"a", "b"}), "b");
  EXPECT_EQ(root.Vector("none", Vec3d(1, 2, 3)), Vec3d(1, 2, 3));
  EXPECT_FALSE(root.Flag("none", false));
  EXPECT_FALSE(root.Optional("none").has_value());
  EXPECT_TRUE(root.Tables("none").empty());
}

TEST(Config, ErrorsNameFileLineKeyAndRemedy) {
  const ConfigTable root = Parsed().root();
  const ConfigTable camera = root.Table("camera");
  EXPECT_EQ(ErrorOf([&] {
              camera.Integer("width", Range{1, 1000});
            }),
            "scene.toml:3: camera.width: is 1350, but must be between 1 and 1000");
  EXPECT_EQ(ErrorOf([&] { camera.Number("flip"); }),
            "scene.toml:5: camera.flip: is true or false, but must be a number");
  EXPECT_EQ(ErrorOf([&] { camera.Number("height"); }),
            "scene.toml:2: camera.height: missing; a number is needed");
  EXPECT_EQ(ErrorOf([&] { camera.Number("widht"); }),
            "scene.toml:2: camera.widht: missing; a number is needed");
  EXPECT_EQ(ErrorOf([&] { root.Number("titel"); }),
            "scene.toml:1: titel: missing; a number is needed (is \"title\" a slip of the pen?)");
  EXPECT_EQ(ErrorOf([&] { camera.Numbers("a", 5); }),
            "scene.toml:4: camera.a: has 3 elements, but must be an array of 5 numbers");
  EXPECT_EQ(ErrorOf([&] { camera.Numbers("a", 3, kNotNegative); }),
            "scene.toml:4: camera.a.2: is -8e-04, but must be at least 0");
  EXPECT_EQ(ErrorOf([&] {
              root.Choice("title", {"x", "y"});
            }),
            "scene.toml:1: title: is \"a test\", but must be one of: x, y");
  EXPECT_EQ(ErrorOf([&] { root.Table("title"); }), "scene.toml:1: title: is a string, but must be a table");
  EXPECT_EQ(ErrorOf([&] { root.Table("light").Tables("source")[1].Integer("spread"); }),
            "scene.toml:9: light.source.1.spread: is a number with a fraction, but must be an integer "
            "(no point, no exponent)");
  EXPECT_EQ(ErrorOf([&] { camera.Fail("a", "makes no camera"); }), "scene.toml:4: camera.a: makes no camera");
}

TEST(Config, NotFiniteIsOutOfEveryRange) {
  const ConfigTable root = Config::Parse("a = nan\nb = inf\nc = 0.0\nd = -inf", "f.toml").root();
  EXPECT_EQ(ErrorOf([&] { root.Number("a"); }), "f.toml:1: a: is nan, but must be a finite number");
  EXPECT_EQ(ErrorOf([&] { root.Number("b", kNotNegative); }), "f.toml:2: b: is inf, but must be at least 0");
  EXPECT_EQ(ErrorOf([&] { root.Number("c", kPositive); }), "f.toml:3: c: is 0, but must be above 0");
  EXPECT_EQ(ErrorOf([&] {
              root.Number("d", Range{-HUGE_VAL, 5});
            }),
            "f.toml:4: d: is -inf, but must be at most 5");
  EXPECT_EQ(root.Number("c", kFraction), 0.0);
}

TEST(Config, SyntaxErrorsAndHugeNumbersHaveALine) {
  EXPECT_TRUE(ErrorOf([] { Config::Parse("a = 1\nb = = 2", "f.toml"); }).starts_with("f.toml:2: not TOML: "));
  EXPECT_TRUE(ErrorOf([] { Config::Parse("a = 1\n\na = 2", "f.toml"); }).starts_with("f.toml:3: not TOML: "));
  EXPECT_TRUE(ErrorOf([] { Config::Parse("n = 99999999999999999999", "f.toml"); }).starts_with("f.toml:1: "));
  EXPECT_TRUE(ErrorOf([] { Config::Parse("n = \"\xff\xfe\"", "f.toml"); }).starts_with("f.toml:1: not TOML"));
}

TEST(Config, UnknownKeysAreRejectedWithASuggestion) {
  const Config config = Config::Parse("[camera]\nwidth = 3\nheigth = 4\n[sensor]\nx = 1\n", "f.toml");
  const ConfigTable camera = config.root().Table("camera");
  camera.Number("width");
  camera.Number("height", 5.0);
  EXPECT_EQ(ErrorOf([&] { config.RejectUnknown(); }),
            "f.toml:3: camera.heigth: unknown key; is \"height\" meant?");
  camera.Has("heigth");
  EXPECT_EQ(ErrorOf([&] { config.RejectUnknown(); }), "f.toml:4: sensor: unknown key; known here: camera");
  config.root().Has("sensor");
  EXPECT_EQ(ErrorOf([&] { config.RejectUnknown(); }), "f.toml:5: sensor.x: unknown key");
  config.root().Table("sensor").Number("x");
  config.RejectUnknown();
}

TEST(Config, UnknownKeysAreFoundInArraysOfTables) {
  const Config config = Config::Parse("[[s]]\na = 1\n[[s]]\na = 2\nbb = 3\n", "f.toml");
  for (const ConfigTable& table : config.root().Tables("s")) table.Number("a");
  EXPECT_EQ(ErrorOf([&] { config.RejectUnknown(); }), "f.toml:5: s.1.bb: unknown key; known here: a");
}

TEST(Config, SettingsComeOnTop) {
  const ConfigTable root =
      Parsed({"camera.width=640", "title=a bare word", "light.source.1.spread=0.5", "camera.a.2=4",
              "new.table.key=[1, 2]", "files.mesh=here/x.ply", "quoted.path=\"sub/y.ply\"",
              "camera.flip=false", "late={ b = 1 }", "late.b=2", "empty="})
          .root();
  EXPECT_EQ(root.Table("camera").Integer("width"), 640);
  EXPECT_EQ(root.String("title"), "a bare word");
  EXPECT_EQ(root.Table("light").Tables("source")[1].Number("spread"), 0.5);
  EXPECT_EQ(root.Table("camera").Numbers("a"), (std::vector<double>{769.2, 0, 4}));
  EXPECT_EQ(root.Table("new").Table("table").Numbers("key"), (std::vector<double>{1, 2}));
  EXPECT_EQ(root.Table("files").Path("mesh"), "here/x.ply");  // from the working folder
  EXPECT_EQ(root.Table("quoted").Path("path"), "sub/y.ply");
  EXPECT_FALSE(root.Table("camera").Flag("flip", true));
  EXPECT_EQ(root.Table("late").Integer("b"), 2);
  EXPECT_EQ(root.String("empty"), "");
}

TEST(Config, ErrorsOfSettingsNameTheSetting) {
  const Config config = Parsed({"camera.width=-3", "camera.wdith=4", "light={ gain = -1 }", "new.x=1"});
  const ConfigTable camera = config.root().Table("camera");
  EXPECT_EQ(ErrorOf([&] { camera.Integer("width", kPositive); }),
            "--set camera.width=-3: camera.width: is -3, but must be above 0");
  EXPECT_EQ(ErrorOf([&] { config.root().Table("light").Number("gain", kPositive); }),
            "--set light={ gain = -1 }: light.gain: is -1, but must be above 0");
  EXPECT_EQ(ErrorOf([&] { config.root().Table("new").Number("y"); }),
            "--set new.x=1: new.y: missing; a number is needed");
  EXPECT_EQ(ErrorOf([] { Parsed({"camera.width"}); }), "--set camera.width: write it as path.to.key=value");
  EXPECT_EQ(ErrorOf([] { Parsed({"camera..x=1"}); }), "--set camera..x=1: a part of the path is empty");
  EXPECT_EQ(ErrorOf([] { Parsed({"title.x=1"}); }), "--set title.x=1: title is a string and has no \"x\"");
  EXPECT_EQ(
      ErrorOf([] { Parsed({"light.source.2.spread=1"}); }),
      "--set light.source.2.spread=1: light.source is an array of 2, counted from 0; \"2\" is none of its "
      "elements");
  EXPECT_TRUE(ErrorOf([] {
                Parsed({"camera.a=[1, 2"});
              }).starts_with("--set camera.a=[1, 2: not a value in TOML's notation: "));
}

TEST(Config, UnknownSettingIsNamed) {
  const Config config = Config::Parse("", "f.toml", {}, {"seconds=3"});
  config.root().Number("second", 1.0);
  EXPECT_EQ(ErrorOf([&] { config.RejectUnknown(); }),
            "--set seconds=3: seconds: unknown key; is \"second\" meant?");
}

TEST(Config, MissingFileIsNamed) {
  const test::ScratchFolder scratch;
  EXPECT_EQ(ErrorOf([&] { Config::Read(scratch / "none.toml"); }),
            (scratch / "none.toml").string() + ": cannot read: No such file or directory");
  WriteFile(scratch / "x.toml", "mesh = \"m.ply\"");
  EXPECT_EQ(Config::Read(scratch / "x.toml").root().Path("mesh"), scratch / "m.ply");
}

// A file on its base, in folders of their own.
class ConfigWithBase : public testing::Test {
 protected:
  ConfigWithBase() {
    std::filesystem::create_directory(scratch_ / "common");
    WriteFile(scratch_ / "common/base.toml", R"(name = "base"
[camera]
width = 10
mask = "mask.png"
[[light.source]]
spread = 1
[[light.source]]
spread = 2
)");
    WriteFile(scratch_ / "own.toml", R"(base = "common/base.toml"
[camera]
width = 20
[light]
source = [{spread = 3}]
[files]
mesh = "own.ply"
)");
  }

  Config Read(const std::vector<std::string>& settings = {}) {
    return Config::ReadWithBase(scratch_ / "own.toml", settings);
  }

  test::ScratchFolder scratch_;
};

TEST_F(ConfigWithBase, JoinsTablesAndReplacesTheRest) {
  const Config config = Read({"camera.height=5"});
  const ConfigTable root = config.root();
  EXPECT_EQ(root.String("name"), "base");
  EXPECT_EQ(root.Table("camera").Integer("width"), 20);
  EXPECT_EQ(root.Table("camera").Integer("height"), 5);
  EXPECT_EQ(root.Table("camera").Path("mask"), scratch_ / "common/mask.png");
  EXPECT_EQ(root.Table("files").Path("mesh"), scratch_ / "own.ply");
  const auto sources = root.Table("light").Tables("source");
  ASSERT_EQ(sources.size(), 1u);
  EXPECT_EQ(sources[0].Number("spread"), 3);
  config.RejectUnknown();
}

TEST_F(ConfigWithBase, ErrorsNameTheFileThatTheKeyStandsIn) {
  const ConfigTable root = Read().root();
  const ConfigTable camera = root.Table("camera");
  const std::string own = (scratch_ / "own.toml").string(), base = (scratch_ / "common/base.toml").string();
  EXPECT_EQ(ErrorOf([&] { camera.Number("mask"); }),
            base + ":4: camera.mask: is a string, but must be a number");
  EXPECT_EQ(ErrorOf([&] {
              camera.Integer("width", Range{1, 2});
            }),
            own + ":3: camera.width: is 20, but must be between 1 and 2");
  EXPECT_EQ(ErrorOf([&] { root.Table("files").Number("mesh"); }),
            own + ":7: files.mesh: is a string, but must be a number");
}

TEST_F(ConfigWithBase, ABaseThatIsMissingOrHasOneItselfIsRefused) {
  WriteFile(scratch_ / "own.toml", "base = \"none.toml\"\n");
  EXPECT_EQ(ErrorOf([&] { Read(); }), (scratch_ / "own.toml").string() + ":1: base: there is no file " +
                                          (scratch_ / "none.toml").string());
  WriteFile(scratch_ / "none.toml", "\nbase = \"own.toml\"\n");
  EXPECT_EQ(ErrorOf([&] { Read(); }),
            (scratch_ / "none.toml").string() + ":2: base: a base has no base of its own; leave it out");
}

}  // namespace
}  // namespace lumen
