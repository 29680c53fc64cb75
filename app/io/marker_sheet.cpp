// SPDX-License-Identifier: Apache-2.0
#include "app/io/marker_sheet.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "calib/vision/tag_pattern.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// mm, as printers and scissors need them.
constexpr double kPageMargin = 12.0;
constexpr double kHeader = 8.0;
constexpr double kFooter = 18.0;
constexpr double kToCut = 2.0;      // from the white margin to the line where to cut
constexpr double kLabel = 6.0;      // below a marker
constexpr double kDimension = 6.0;  // above it
constexpr double kRuler = 100.0;
constexpr double kText = 2.8;  // height of letters
constexpr double kPointPerMm = 72.0 / 25.4;

struct Size {
  double width = 0.0;
  double height = 0.0;
};

Size size_of(Paper paper) { return paper == Paper::kA4 ? Size{210.0, 297.0} : Size{215.9, 279.4}; }

// Where markers stand: boxes of one size in columns and rows.
struct Grid {
  double cell = 0.0;     // mm, of a marker's pattern
  double pattern = 0.0;  // mm, with its white margin
  Size box;
  int columns = 0;
  int rows = 0;
};

// Of a square of `pattern` mm.
Size box_around(double pattern) {
  return {pattern + 2.0 * kToCut, pattern + 2.0 * kToCut + kLabel + kDimension};
}

Size room_on(Paper paper) {
  const Size page = size_of(paper);
  return {page.width - 2.0 * kPageMargin, page.height - 2.0 * kPageMargin - kHeader - kFooter};
}

Grid grid_of(const MarkerSheet& sheet, const TagPattern& pattern) {
  constexpr double kMmPerM = 1000.0;
  Grid out;
  out.cell = kMmPerM * sheet.size_m / pattern.edge;
  out.pattern = out.cell * pattern.cells;
  out.box = box_around(out.pattern);
  const Size room = room_on(sheet.paper);
  out.columns = static_cast<int>(room.width / out.box.width);
  out.rows = static_cast<int>(room.height / out.box.height);
  if (out.columns > 0 && out.rows > 0) return out;
  const Size around = box_around(0.0);
  const double most = std::min(room.width - around.width, room.height - around.height) *
                      pattern.edge / pattern.cells;
  throw bad_request(
      "--size",
      fmt::format("a marker of {:.4g} m does not fit on {}", sheet.size_m, to_string(sheet.paper)),
      fmt::format("at most {:.3f} m; sizes are in m", std::floor(most) / kMmPerM));
}

// The operators of a page (ISO 32000-1, 8 and 9); mm from the lower left.
class Drawing {
 public:
  Drawing() { add("{:.6f} 0 0 {:.6f} 0 0 cm", kPointPerMm, kPointPerMm); }

  void text(double x, double y, std::string_view words) {
    std::string escaped;
    for (const char c : words) {
      if (c == '(' || c == ')' || c == '\\') escaped += '\\';
      escaped += c;
    }
    add("BT /F {:.2f} Tf {:.3f} {:.3f} Td ({}) Tj ET", kText, x, y, escaped);
  }

  void line(double x0, double y0, double x1, double y1, double width = 0.2) {
    add("{:.2f} w {:.3f} {:.3f} m {:.3f} {:.3f} l S", width, x0, y0, x1, y1);
  }

  /// Thin, grey and dashed.
  void cutting_line(double x, double y, const Size& box) {
    add("q 0.6 G 0.1 w [1 1] 0 d {:.3f} {:.3f} {:.3f} {:.3f} re S Q", x, y, box.width, box.height);
  }

  /// As an image of one bit a cell: cells that are drawn one by one show seams.
  void pattern(double x, double y, double side, const TagPattern& tag) {
    constexpr int kBits = 8;
    std::string rows;
    for (int row = 0; row < tag.cells; ++row) {
      for (int first = 0; first < tag.cells; first += kBits) {
        unsigned byte = 0;
        for (int column = first; column < first + kBits; ++column) {
          const bool bright =
              column < tag.cells && tag.bright[static_cast<std::size_t>(row * tag.cells + column)];
          byte = 2 * byte + (bright ? 1 : 0);
        }
        rows += fmt::format("{:02x}", byte);
      }
    }
    add("q {:.4f} 0 0 {:.4f} {:.4f} {:.4f} cm BI /W {} /H {} /BPC 1 /CS /G /F /AHx ID {}> EI Q",
        side, side, x, y, tag.cells, tag.cells, rows);
  }

  [[nodiscard]] const std::string& operators() const { return operators_; }

 private:
  template <typename... Args>
  void add(fmt::format_string<Args...> words, Args&&... args) {
    operators_ += fmt::format(words, std::forward<Args>(args)...) + "\n";
  }

  std::string operators_;
};

// Between two corners: what is measured as the size.
void draw_dimension(double x0, double x1, double y, Drawing& out) {
  constexpr double kTick = 1.2;
  out.line(x0, y, x1, y);
  for (const double x : {x0, x1}) out.line(x, y - kTick, x, y + kTick);
}

void draw_marker(double x, double y, const Grid& grid, const MarkerSheet& sheet, int id,
                 Drawing& out) {
  const TagPattern tag = tag_pattern(sheet.family, id);
  const double margin = tag.margin() * grid.cell;
  out.cutting_line(x, y, grid.box);
  const double left = x + kToCut;
  const double bottom = y + kToCut + kLabel;
  out.pattern(left, bottom, grid.pattern, tag);
  draw_dimension(left + margin, left + grid.pattern - margin,
                 bottom + grid.pattern + 0.5 * kDimension, out);
  out.text(left, y + kToCut + 1.0, fmt::format("{}   {:.4g} mm", id, 1000.0 * sheet.size_m));
}

void draw_ruler(Drawing& out) {
  constexpr int kCentimetres = 10;
  constexpr double kTick = 2.0;
  const double y = kPageMargin + 6.0;
  out.line(kPageMargin, y, kPageMargin + kRuler, y, 0.3);
  for (int k = 0; k <= kCentimetres; ++k) {
    const double x = kPageMargin + k * kRuler / kCentimetres;
    out.line(x, y, x, y + kTick, 0.3);
  }
  out.text(kPageMargin + kRuler + 3.0, y, "100 mm, if the printer did not scale the page");
  out.text(kPageMargin, kPageMargin,
           "Measure a marker along the line above it, and write what you measure into tags.yaml.");
}

std::string page_of(const MarkerSheet& sheet, const Grid& grid, int page, int pages) {
  const Size paper = size_of(sheet.paper);
  Drawing out;
  out.text(kPageMargin, paper.height - kPageMargin - kText,
           fmt::format("{}, {:.4g} mm. Print at 100 %, matt, and keep the white margin.   {} / {}",
                       sheet.family, 1000.0 * sheet.size_m, page + 1, pages));
  draw_ruler(out);
  const int on_page = grid.columns * grid.rows;
  const int first = on_page * page;
  const int end = std::min(static_cast<int>(sheet.ids.size()), first + on_page);
  for (int k = first; k < end; ++k) {
    const int place = k - first;
    const double x = kPageMargin + place % grid.columns * grid.box.width;
    const int row = place / grid.columns;
    const double y = paper.height - kPageMargin - kHeader - (row + 1) * grid.box.height;
    draw_marker(x, y, grid, sheet, sheet.ids[static_cast<std::size_t>(k)], out);
  }
  return out.operators();
}

// Objects, their table and the trailer (ISO 32000-1, 7.5).
std::string document_of(const Size& page, const std::vector<std::string>& pages) {
  constexpr int kFirstPage = 4;  // after catalogue, list of pages and font
  std::vector<std::string> objects{"<< /Type /Catalog /Pages 2 0 R >>"};
  std::string kids;
  for (std::size_t k = 0; k < pages.size(); ++k) kids += fmt::format("{} 0 R ", kFirstPage + 2 * k);
  objects.push_back(
      fmt::format("<< /Type /Pages /Count {} /Kids [ {}] /MediaBox [0 0 {:.3f} {:.3f}] >>",
                  pages.size(), kids, kPointPerMm * page.width, kPointPerMm * page.height));
  objects.emplace_back("<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>");
  for (const std::string& operators : pages) {
    objects.push_back(
        fmt::format("<< /Type /Page /Parent 2 0 R /Contents {} 0 R "
                    "/Resources << /Font << /F 3 0 R >> >> >>",
                    objects.size() + 2));
    objects.push_back(
        fmt::format("<< /Length {} >>\nstream\n{}endstream", operators.size(), operators));
  }
  std::string out = "%PDF-1.4\n";
  std::string table = fmt::format("xref\n0 {}\n0000000000 65535 f \n", objects.size() + 1);
  for (std::size_t k = 0; k < objects.size(); ++k) {
    table += fmt::format("{:010} 00000 n \n", out.size());
    out += fmt::format("{} 0 obj\n{}\nendobj\n", k + 1, objects[k]);
  }
  return fmt::format("{0}{1}trailer\n<< /Size {2} /Root 1 0 R >>\nstartxref\n{3}\n%%EOF\n", out,
                     table, objects.size() + 1, out.size());
}

}  // namespace

std::string_view to_string(Paper paper) { return paper == Paper::kA4 ? "A4" : "letter"; }

SheetPdf marker_sheet_pdf(const MarkerSheet& sheet) {
  KINESCOPE_CHECK(!sheet.ids.empty(), "a sheet has markers");
  const Grid grid = grid_of(sheet, tag_pattern(sheet.family, sheet.ids.front()));
  const int on_page = grid.columns * grid.rows;
  const int pages = (static_cast<int>(sheet.ids.size()) + on_page - 1) / on_page;
  std::vector<std::string> drawn;
  for (int page = 0; page < pages; ++page) drawn.push_back(page_of(sheet, grid, page, pages));
  return {document_of(size_of(sheet.paper), drawn), pages};
}

}  // namespace kinescope
