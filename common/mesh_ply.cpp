// PLY, in text and in binary of either byte order (Turk, "The PLY polygon file format", 1994).
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <stdexcept>

#include "common/error.h"
#include "common/files.h"
#include "common/line_reader.h"
#include "common/mesh_files.h"

namespace lumen {
namespace {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

constexpr std::array<size_t, 8> kSize = {1, 1, 2, 2, 4, 4, 4, 8};

std::optional<Type> TypeNamed(std::string_view name) {
  constexpr std::pair<std::string_view, Type> kNames[] = {
      {"char", Type::kInt8},      {"int8", Type::kInt8},     {"uchar", Type::kUint8},
      {"uint8", Type::kUint8},    {"short", Type::kInt16},   {"int16", Type::kInt16},
      {"ushort", Type::kUint16},  {"uint16", Type::kUint16}, {"int", Type::kInt32},
      {"int32", Type::kInt32},    {"uint", Type::kUint32},   {"uint32", Type::kUint32},
      {"float", Type::kFloat},    {"float32", Type::kFloat}, {"double", Type::kDouble},
      {"float64", Type::kDouble},
  };
  for (const auto& [known, type] : kNames) {
    if (known == name) return type;
  }
  return std::nullopt;
}

struct Property {
  std::string name;
  Type type = Type::kFloat;
  std::optional<Type> count_type;  // of a list
};

struct Element {
  std::string name;
  int64_t count = 0;
  std::vector<Property> properties;

  // Position of a scalar property or of a list; −1 = none.
  int FindScalar(std::string_view property) const { return Find(property, false); }
  int FindList(std::string_view property) const { return Find(property, true); }

 private:
  int Find(std::string_view property, bool is_list) const {
    for (size_t i = 0; i < properties.size(); ++i) {
      if (properties[i].name == property && properties[i].count_type.has_value() == is_list) {
        return static_cast<int>(i);
      }
    }
    return -1;
  }
};

enum class Format { kText, kLittleEndian, kBigEndian };

struct Header {
  Format format = Format::kText;
  std::vector<Element> elements;
};

Property ParseProperty(LineReader* reader) {
  Property property;
  std::string_view type = reader->Word();
  if (type == "list") {
    property.count_type = TypeNamed(reader->Word());
    if (!property.count_type) reader->Fail("a list's count has an unknown type");
    type = reader->Word();
  }
  const auto known = TypeNamed(type);
  if (!known) reader->Fail("unknown type of property \"" + std::string(type) + "\"");
  property.type = *known;
  property.name = reader->Word();
  if (property.name.empty()) reader->Fail("a property without a name");
  return property;
}

Header ParseHeader(LineReader* reader) {
  Header header;
  if (!reader->NextLine() || reader->Word() != "ply")
    reader->Fail("not a PLY file: it should start with ply");
  while (reader->NextLine()) {
    const std::string_view keyword = reader->Word();
    if (keyword == "end_header") return header;
    if (keyword == "format") {
      const std::string_view format = reader->Word();
      if (format == "binary_little_endian") {
        header.format = Format::kLittleEndian;
      } else if (format == "binary_big_endian") {
        header.format = Format::kBigEndian;
      } else if (format != "ascii") {
        reader->Fail("unknown format \"" + std::string(format) + "\"");
      }
    } else if (keyword == "element") {
      Element element;
      element.name = reader->Word();
      element.count = reader->Integer("the number of elements");
      if (element.count < 0) reader->Fail("a negative number of elements");
      header.elements.push_back(element);
    } else if (keyword == "property") {
      if (header.elements.empty()) reader->Fail("a property before the first element");
      header.elements.back().properties.push_back(ParseProperty(reader));
    } else if (!keyword.empty() && keyword != "comment" && keyword != "obj_info") {
      reader->Fail("unknown keyword \"" + std::string(keyword) + "\" in the header");
    }
  }
  reader->Fail("the file ends inside its header");
}

// Delivers the values behind the header one by one, whatever the format.
class Values {
 public:
  Values(const std::filesystem::path& file, std::string_view text, LineReader* reader, Format format)
      : file_(file.string()), text_(text), reader_(reader), format_(format), at_(reader->offset()) {}

  void StartElement(const Element& element) {
    element_ = &element;
    index_ = 0;
  }

  // Starts row `index` of the element.
  void StartRow(int64_t index) {
    index_ = index;
    if (format_ != Format::kText) return;
    do {
      if (!reader_->NextLine()) Fail("the file ends before it");
    } while (reader_->rest().find_first_not_of(" \t\r") == std::string_view::npos);
  }

  double Next(Type type) {
    if (format_ == Format::kText) {
      const std::string_view word = reader_->Word();
      if (word.empty()) Fail("too few numbers");
      return reader_->ToNumber(word, "a number of " + Place());
    }
    const size_t size = kSize[static_cast<size_t>(type)];
    if (text_.size() - at_ < size) Fail("the file ends within or before it");
    const bool swap = (format_ == Format::kLittleEndian) != (std::endian::native == std::endian::little);
    char bytes[8];
    for (size_t i = 0; i < size; ++i) bytes[i] = text_[at_ + (swap ? size - 1 - i : i)];
    at_ += size;
    return Decoded(type, bytes);
  }

  // Bounded so that a damaged count can't ask for more memory than the file has bytes.
  int64_t NextCount(Type type) {
    const double count = Next(type);
    if (!(count >= 0) || count > static_cast<double>(text_.size())) Fail("a list with an impossible count");
    return static_cast<int64_t>(count);
  }

  [[noreturn]] void Fail(const std::string& problem) const {
    const std::string message = Place() + ": " + problem;
    if (format_ == Format::kText) reader_->Fail(message);
    throw InputError(file_ + ": " + message);
  }

 private:
  std::string Place() const {
    return element_->name + " " + std::to_string(index_) + " of " + std::to_string(element_->count);
  }

  template <class T>
  static double As(const char* bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return static_cast<double>(value);
  }

  static double Decoded(Type type, const char* bytes) {
    switch (type) {
      case Type::kInt8:
        return As<int8_t>(bytes);
      case Type::kUint8:
        return As<uint8_t>(bytes);
      case Type::kInt16:
        return As<int16_t>(bytes);
      case Type::kUint16:
        return As<uint16_t>(bytes);
      case Type::kInt32:
        return As<int32_t>(bytes);
      case Type::kUint32:
        return As<uint32_t>(bytes);
      case Type::kFloat:
        return As<float>(bytes);
      case Type::kDouble:
        return As<double>(bytes);
    }
    return 0;
  }

  std::string file_;
  std::string_view text_;
  LineReader* reader_;
  Format format_;
  size_t at_;
  const Element* element_ = nullptr;
  int64_t index_ = 0;
};

// Reads a row's scalars into `row`, by position of the property; lists are passed over but for `list`, which
// gets the one at position `list_at`.
void ReadRow(Values* values, const Element& element, std::vector<double>* row, int list_at,
             std::vector<double>* list) {
  for (size_t i = 0; i < element.properties.size(); ++i) {
    const Property& property = element.properties[i];
    if (!property.count_type) {
      (*row)[i] = values->Next(property.type);
      continue;
    }
    const int64_t count = values->NextCount(*property.count_type);
    const bool wanted = static_cast<int>(i) == list_at;
    if (wanted) list->clear();
    for (int64_t k = 0; k < count; ++k) {
      const double value = values->Next(property.type);
      if (wanted) list->push_back(value);
    }
  }
}

void ReadVertices(Values* values, const Element& element, Mesh* mesh) {
  const int position[3] = {element.FindScalar("x"), element.FindScalar("y"), element.FindScalar("z")};
  const int color[3] = {element.FindScalar("red"), element.FindScalar("green"), element.FindScalar("blue")};
  if (*std::min_element(position, position + 3) < 0) values->Fail("the vertices have no x, y and z");
  const bool has_color = *std::min_element(color, color + 3) >= 0;
  std::vector<double> row(element.properties.size());
  for (int64_t i = 0; i < element.count; ++i) {
    values->StartRow(i);
    ReadRow(values, element, &row, -1, nullptr);
    const Vec3d vertex(row[position[0]], row[position[1]], row[position[2]]);
    if (!vertex.allFinite()) values->Fail("a coordinate is not finite");
    mesh->vertices.push_back(vertex);
    if (!has_color) continue;
    std::array<uint8_t, 3> rgb{};
    for (int c = 0; c < 3; ++c) {
      const Type type = element.properties[color[c]].type;
      const bool fraction = type == Type::kFloat || type == Type::kDouble;
      const double level = row[color[c]] * (fraction ? 255 : type == Type::kUint16 ? 255.0 / 65535 : 1);
      rgb[c] = static_cast<uint8_t>(std::lround(std::clamp(level, 0.0, 255.0)));
    }
    mesh->colors.push_back(rgb);
  }
}

void ReadFaces(Values* values, const Element& element, int64_t vertices, Mesh* mesh) {
  const int list_at = std::max(element.FindList("vertex_indices"), element.FindList("vertex_index"));
  if (list_at < 0) values->Fail("the faces have no vertex_indices");
  std::vector<double> row(element.properties.size()), polygon;
  for (int64_t i = 0; i < element.count; ++i) {
    values->StartRow(i);
    ReadRow(values, element, &row, list_at, &polygon);
    if (polygon.size() < 3) values->Fail("has " + std::to_string(polygon.size()) + " corners");
    for (double index : polygon) {
      if (!(index >= 0 && index < static_cast<double>(vertices)) || index != std::floor(index)) {
        std::string number;
        AppendNumber(&number, index);
        values->Fail("names vertex " + number + ", but there are " + std::to_string(vertices) +
                     ", counted from 0");
      }
    }
    for (size_t c = 2; c < polygon.size(); ++c) {
      mesh->faces.push_back(Vec3d(polygon[0], polygon[c - 1], polygon[c]).cast<int>());
    }
  }
}

template <class T>
void AppendLittleEndian(std::string* bytes, T value) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  if (std::endian::native != std::endian::little) std::reverse(raw, raw + sizeof raw);
  bytes->append(raw, sizeof raw);
}

}  // namespace

Mesh ReadPly(const std::filesystem::path& file, std::string_view text) {
  LineReader reader(file, text);
  const Header header = ParseHeader(&reader);
  Values values(file, text, &reader, header.format);
  int64_t vertices = 0;
  for (const Element& element : header.elements) {
    if (element.name == "vertex") vertices = element.count;
  }
  Mesh mesh;
  for (const Element& element : header.elements) {
    values.StartElement(element);
    if (element.name == "vertex") {
      ReadVertices(&values, element, &mesh);
    } else if (element.name == "face") {
      ReadFaces(&values, element, vertices, &mesh);
    } else if (!element.properties.empty()) {
      std::vector<double> row(element.properties.size());
      for (int64_t i = 0; i < element.count; ++i) {
        values.StartRow(i);
        ReadRow(&values, element, &row, -1, nullptr);
      }
    }
  }
  return mesh;
}

std::string PlyText(const Mesh& mesh, const std::vector<FaceProperty>& properties) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                      std::to_string(mesh.vertices.size()) +
                      "\nproperty double x\nproperty double y\nproperty double z\n";
  if (!mesh.colors.empty()) bytes += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  bytes += "element face " + std::to_string(mesh.faces.size()) + "\nproperty list uchar int vertex_indices\n";
  for (const FaceProperty& property : properties) {
    const bool whole = std::holds_alternative<std::vector<int32_t>>(property.values);
    bytes += std::string("property ") + (whole ? "int " : "float ") + property.name + "\n";
  }
  bytes += "end_header\n";
  bytes.reserve(bytes.size() + mesh.vertices.size() * 27 + mesh.faces.size() * (13 + 4 * properties.size()));
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (double coordinate : mesh.vertices[i]) AppendLittleEndian(&bytes, coordinate);
    if (mesh.colors.empty()) continue;
    for (uint8_t channel : mesh.colors[i]) bytes += static_cast<char>(channel);
  }
  for (size_t face = 0; face < mesh.faces.size(); ++face) {
    bytes += '\3';
    for (int32_t corner : mesh.faces[face]) AppendLittleEndian(&bytes, corner);
    for (const FaceProperty& property : properties) {
      std::visit([&](const auto& values) { AppendLittleEndian(&bytes, values[face]); }, property.values);
    }
  }
  return bytes;
}

void WriteFaceProperties(const std::filesystem::path& file, const Mesh& mesh,
                         const std::vector<FaceProperty>& properties) {
  for (const FaceProperty& property : properties) {
    const size_t count = std::visit([](const auto& values) { return values.size(); }, property.values);
    if (count != mesh.faces.size()) {
      throw std::logic_error("WriteFaceProperties: " + property.name + " needs a value a face");
    }
  }
  WriteFile(file, PlyText(mesh, properties));
}

}  // namespace lumen
