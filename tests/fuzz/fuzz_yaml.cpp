// SPDX-License-Identifier: Apache-2.0
//
// camera.yaml in all its formats (the XML of OpenCV, too), tags.yaml, recording.yaml.
#include "app/io/dynamics_settings.h"
#include "app/io/recording.h"
#include "calib/camera/camera_file.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  const std::string_view text = fuzz::text_of(data, size);
  const std::filesystem::path path = fuzz::file_of(text, "settings.yaml");
  fuzz::expect_answer([&] { (void)read_camera(path); });
  fuzz::expect_answer([&] { (void)read_marker_set(path); });
  fuzz::expect_answer([&] { (void)read_recording_settings(path); });
  fuzz::expect_answer([&] { (void)read_dynamics_settings(path); });
  return 0;
}
