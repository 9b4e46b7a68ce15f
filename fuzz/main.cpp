// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include NPR_FUZZ_HEADER

// One program for each target: NPR_FUZZ_TARGET is the function that it feeds.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  nerf_pose_refiner::NPR_FUZZ_TARGET(data, size);
  return 0;
}

#ifdef NPR_FUZZ_REPLAY

#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

// Without the fuzzer: feeds it with the files of folders, to count the lines that these reach.
int main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    for (const auto& entry : std::filesystem::directory_iterator(argv[i])) {
      std::ifstream file(entry.path(), std::ios::binary);
      const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
      LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    }
  }
  return 0;
}

#endif
