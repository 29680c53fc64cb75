// SPDX-License-Identifier: Apache-2.0
//
// corners.csv, poses.csv and points.csv.
#include "app/io/recording.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kinescope;
  const std::filesystem::path path = fuzz::file_of(fuzz::text_of(data, size), "sightings.csv");
  MarkerSet markers;
  markers.default_size_m = 0.05;
  fuzz::expect_answer([&] { (void)read_corners(path, markers); });
  fuzz::expect_answer([&] { (void)read_poses(path); });
  fuzz::expect_answer([&] { (void)read_points(path); });
  return 0;
}
