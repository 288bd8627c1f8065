// Feeds a fuzz target every file of a folder, and each file again cut and with bytes changed. The
// input lies at the end of an allocation of exactly its size, so that reading past it is found by
// the address sanitizer.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

void feed(const Bytes& bytes) {
  const std::unique_ptr<std::uint8_t[]> exact(new std::uint8_t[bytes.size()]);
  std::copy(bytes.begin(), bytes.end(), exact.get());
  LLVMFuzzerTestOneInput(exact.get(), bytes.size());
}

// Few and the same ones in every run: this guards against regressions, the fuzzer searches.
void feed_variants(const Bytes& bytes) {
  constexpr std::size_t kVariants = 40;
  std::minstd_rand random(1);
  for (std::size_t i = 0; i < kVariants && !bytes.empty(); ++i) {
    feed(
        Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(random() % bytes.size())));
    Bytes changed = bytes;
    for (int k = 0; k < 3; ++k) {
      changed[random() % changed.size()] = static_cast<std::uint8_t>(random());
    }
    feed(changed);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s <folder of inputs>\n", argv[0]);
    return 2;
  }
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(argv[1])) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  feed({});
  for (const auto& file : files) {
    std::ifstream stream(file, std::ios::binary);
    const Bytes bytes(std::istreambuf_iterator<char>(stream), {});
    feed(bytes);
    feed_variants(bytes);
  }
  std::printf("%zu files and their variants\n", files.size());
  return files.empty() ? 1 : 0;
}
