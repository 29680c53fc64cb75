// SPDX-License-Identifier: Apache-2.0
//
// Lines of joint values as `kinescope capture` receives them: byte 1 ends a piece that came at
// once, byte 2 one that came after a second of silence.
#include <cmath>

#include "app/capture/joint_feed.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  const std::string_view text = fuzz::text_of(data, size);
  fuzz::expect_answer([&] {
    JointLines lines;
    double now_s = 0.0;
    double last_s = 0.0;
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t end = text.find_first_of("\x01\x02", begin);
      const bool silent = end != std::string_view::npos && text[end] == '\x02';
      now_s += silent ? 1.0 : 0.01;
      for (const JointRow& row : lines.add(text.substr(begin, end - begin), now_s)) {
        KINESCOPE_CHECK(std::isfinite(row.stamp_s) && row.stamp_s > last_s, "a log goes forward");
        KINESCOPE_CHECK(row.values.size() == lines.channels().size(), "a row has all channels");
        last_s = row.stamp_s;
      }
      for (const std::string& warning : lines.take_warnings())
        KINESCOPE_CHECK(warning.find('\n') == std::string::npos, "a warning is one line");
      if (end == std::string_view::npos) break;
      begin = end + 1;
    }
  });
  return 0;
}
