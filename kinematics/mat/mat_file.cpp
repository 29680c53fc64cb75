// SPDX-License-Identifier: Apache-2.0
#include "kinematics/mat/mat_file.h"

#include <algorithm>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/mat/mat_elements.h"

namespace kinescope::mat {
namespace {

constexpr std::size_t kHeader = 128;
constexpr std::size_t kMostBytes = std::size_t{1} << 30U;  // unpacked, of all variables

// Array types (MAT-File Format, table 1-3).
enum class ArrayClass : std::uint8_t {
  kCell = 1,
  kStruct = 2,
  kObject = 3,
  kChar = 4,
  kSparse = 5,
  kDouble = 6,
  kUint64 = 15,
  kOpaque = 17  // tables, times, strings: not in the format's description, which ends before
};
constexpr std::uint32_t kComplexFlag = 0x0800;

[[noreturn]] void refuse(const std::string& source, const std::string& what) {
  throw bad_input(source, what, "save it in MATLAB with: save -v7 FILE t q dq tau");
}

// True for big-endian. Throws for what is no MAT-file of level 5.
bool read_header(std::string_view bytes, const std::string& source) {
  if (bytes.empty()) refuse(source, "the file is empty");
  if (bytes.starts_with("MATLAB 7.3 MAT-file") || bytes.starts_with("\x89HDF\r\n\x1a\n"))
    refuse(source, "it is a MAT-file of version 7.3 (HDF5), which is not read");
  if (bytes.size() < kHeader) refuse(source, "it is no MAT-file of level 5");
  const std::string_view order = bytes.substr(126, 2);
  if (order != "IM" && order != "MI") refuse(source, "it is no MAT-file of level 5");
  const bool big_endian = order == "MI";
  const std::uint64_t version = unsigned_of(bytes.substr(124, 2), big_endian);
  if (version >> 8U == 2)
    refuse(source, "it is a MAT-file of version 7.3 (HDF5), which is not read");
  if (version >> 8U != 1) refuse(source, "it is no MAT-file of level 5");
  return big_endian;
}

std::string class_words(ArrayClass kind) {
  switch (kind) {
    case ArrayClass::kCell:
      return "a cell array";
    case ArrayClass::kStruct:
      return "a struct";
    case ArrayClass::kObject:
    case ArrayClass::kOpaque:
      return "an object";
    case ArrayClass::kChar:
      return "a text";
    case ArrayClass::kSparse:
      return "sparse";
    default:
      return "no matrix of numbers";
  }
}

bool is_numeric(ArrayClass kind) {
  return kind >= ArrayClass::kDouble && kind <= ArrayClass::kUint64;
}

// What stands before a variable's numbers.
struct MatrixHead {
  ArrayClass kind = ArrayClass::kDouble;
  bool is_complex = false;
  std::vector<double> sizes;
  std::string name;
};

MatrixHead read_head(ElementReader& elements) {
  MatrixHead out;
  const Element flags = elements.need("flags");
  if (flags.type != ElementType::kUint32 || flags.data.size() != 8)
    throw Damage{"a variable's flags are none"};
  const std::uint64_t word = unsigned_of(flags.data.substr(0, 4), elements.big_endian());
  out.kind = static_cast<ArrayClass>(word & 0xFFU);
  out.is_complex = (word & kComplexFlag) != 0;
  if (out.kind != ArrayClass::kOpaque) {
    const Element sizes = elements.need("sizes");
    if (sizes.type != ElementType::kInt32) throw Damage{"a variable's sizes are none"};
    out.sizes = numbers_of(sizes, elements.big_endian());
    if (out.sizes.size() < 2 || std::ranges::any_of(out.sizes, [](double n) { return n < 0.0; }))
      throw Damage{"a variable's sizes are none"};
  }
  const Element name = elements.need("name");
  if (name.type != ElementType::kInt8) throw Damage{"a variable's name is none"};
  out.name = std::string(name.data.substr(0, name.data.find('\0')));
  return out;
}

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

// As MATLAB and Octave have names.
bool is_variable_name(std::string_view name) {
  if (name.empty() || (!is_letter(name.front()) && name.front() != '_')) return false;
  return std::ranges::all_of(
      name, [](char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; });
}

class VariableReader {
 public:
  explicit VariableReader(bool big_endian) : big_endian_(big_endian) {}

  void read_all(std::string_view bytes) {
    ElementReader elements(bytes, big_endian_);
    while (const auto element = elements.next()) {
      if (element->type == ElementType::kMatrix) read_matrix(element->data);
      if (element->type == ElementType::kCompressed) read_packed(element->data);
    }
  }
  [[nodiscard]] Contents take() { return std::move(contents_); }

 private:
  // A packed element holds one element, which is not packed again.
  void read_packed(std::string_view packed) {
    const std::string bytes = inflated(packed, kMostBytes - unpacked_);
    unpacked_ += bytes.size();
    ElementReader elements(bytes, big_endian_);
    const auto element = elements.next();
    if (element && element->type == ElementType::kMatrix) read_matrix(element->data);
  }

  void read_matrix(std::string_view bytes) {
    ElementReader elements(bytes, big_endian_);
    const MatrixHead head = read_head(elements);
    // MATLAB's own data stand in a variable without a name.
    if (head.name.empty()) return;
    if (!is_variable_name(head.name)) throw Damage{"a variable's name is none"};
    if (!names_.insert(head.name).second)
      throw Damage{fmt::format("two variables are named '{}'", head.name)};
    const auto leave_out = [&](const std::string& what) {
      contents_.left_out.push_back({head.name, what});
    };
    if (!is_numeric(head.kind)) return leave_out(class_words(head.kind));
    if (head.is_complex) return leave_out("complex");
    if (head.sizes.size() != 2)
      return leave_out(fmt::format("of {} dimensions", head.sizes.size()));
    contents_.variables.push_back({head.name, read_numbers(head, elements)});
  }

  Eigen::MatrixXd read_numbers(const MatrixHead& head, ElementReader& elements) {
    const double cells = head.sizes[0] * head.sizes[1];
    const Element real = elements.need("numbers");
    if (static_cast<double>(count_of(real)) != cells)
      throw Damage{fmt::format("'{}' has {} numbers, not {} x {}", head.name, count_of(real),
                               head.sizes[0], head.sizes[1])};
    cells_ += count_of(real);
    if (cells_ > kMostCells) throw Damage{fmt::format("it has more than {} numbers", kMostCells)};
    const std::vector<double> values = numbers_of(real, big_endian_);
    return Eigen::Map<const Eigen::MatrixXd>(values.data(),
                                             static_cast<Eigen::Index>(head.sizes[0]),
                                             static_cast<Eigen::Index>(head.sizes[1]));
  }

  bool big_endian_;
  std::size_t unpacked_ = 0;
  std::size_t cells_ = 0;
  std::set<std::string> names_;
  Contents contents_;
};

}  // namespace

bool is_mat(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  for (char& c : ending)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return ending == ".mat";
}

Contents parse_variables(std::string_view bytes, const std::string& source) {
  const bool big_endian = read_header(bytes, source);
  VariableReader reader(big_endian);
  try {
    reader.read_all(bytes.substr(kHeader));
  } catch (const Damage& damage) {
    throw bad_input(source, "the MAT-file is damaged: " + damage.what,
                    "copy it again, or save it again with: save -v7");
  }
  return reader.take();
}

Contents read_variables(const std::filesystem::path& path) {
  return parse_variables(read_text_file(path), path.string());
}

}  // namespace kinescope::mat
