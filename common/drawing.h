// Pictures made of lines, discs, boxes and text, written as SVG or as pixels from one list.
#pragma once

#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "common/image.h"
#include "common/math.h"

namespace lumen {

// Lengths are px from the upper left corner, y downwards.
struct DrawnLine {
  std::vector<Vec2d> points;
  Rgb8 color;
  double width = 1;
  bool dashed = false;
};

struct DrawnDisc {
  Vec2d centre;
  double radius;
  Rgb8 color;
  double ring = 0;  // width of a ring of that radius; 0 = filled
};

struct DrawnBox {
  Vec2d low, high;  // corners
  Rgb8 color;
};

struct DrawnText {
  Vec2d at;  // on the base line
  std::string text;
  double size = 13;
  Rgb8 color = {40, 40, 40};
  TextAlign align = TextAlign::kLeft;
};

using Shape = std::variant<DrawnLine, DrawnDisc, DrawnBox, DrawnText>;

// On white, drawn in order.
struct Drawing {
  double width = 0, height = 0;
  std::vector<Shape> shapes;
};

// Adds a drawing's shapes to a page, its upper left corner at (x, y).
void Place(const Drawing& drawing, double x, double y, Drawing* page);

std::string ToSvg(const Drawing& drawing);

// Three channels, smooth edges; `scale` pixels a px of the drawing.
Image8 ToImage(const Drawing& drawing, double scale = 1);

// Both, as FOLDER/NAME.svg and .png.
void WritePictures(const Drawing& drawing, const std::filesystem::path& folder, const std::string& name);

// How wide a text comes out, by the mean letter of the sans serif fonts at hand.
double TextWidth(const std::string& text, double size);

}  // namespace lumen
