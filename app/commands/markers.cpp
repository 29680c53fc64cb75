// SPDX-License-Identifier: Apache-2.0
//
// `kinescope markers`: a PDF to print before filming, and the tags.yaml that goes with it.
#include "app/commands/markers.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/io/output_folder.h"
#include "app/report/result_values.h"
#include "kinematics/core/file.h"

namespace kinescope {

ExitCode markers_command(const MarkersOptions& options, const Console& console) {
  const MarkerSheet& sheet = options.sheet;
  const SheetPdf pdf = marker_sheet_pdf(sheet);
  require_folder_of(options.output);
  require_new_file(options.output, "--output", {}, options.force);
  write_file_atomically(options.output, pdf.bytes);
  if (console.json) {
    console.print({{"family", sheet.family},
                   {"ids", sheet.ids},
                   {"size_m", sheet.size_m},
                   {"pages", pdf.pages},
                   {"pdf", report::text(options.output.string())}});
    return ExitCode::kDone;
  }
  fmt::print(
      "{} marker{} of {}, {:.4g} mm, on {} page{} of {}\npdf     {}\n\n"
      "Print at 100 %, measure a marker along the line above it, and put into tags.yaml:\n\n"
      "family: {}\ndefault_size: {:.6g}  # m, as measured\n",
      sheet.ids.size(), sheet.ids.size() == 1 ? "" : "s", sheet.family, 1000.0 * sheet.size_m,
      pdf.pages, pdf.pages == 1 ? "" : "s", to_string(sheet.paper), options.output.string(),
      sheet.family, sheet.size_m);
  return ExitCode::kDone;
}

}  // namespace kinescope
