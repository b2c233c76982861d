// The fuzz target's property on inputs of seeded random bytes, so that every run of the tests drives it.
#include <gtest/gtest.h>

#include <cstdint>
#include <exception>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace sckf::test {
namespace {

TEST(FuzzPipeline, KeepsItsPromisesWhateverComes) {
  constexpr int kInputs = 3000;
  std::mt19937_64 random(1);
  std::uniform_int_distribution<std::size_t> size(0, 300);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int i = 0; i < kInputs; ++i) {
    std::vector<std::uint8_t> data(size(random));
    for (std::uint8_t& value : data) value = static_cast<std::uint8_t>(byte(random));
    try {
      LLVMFuzzerTestOneInput(data.data(), data.size());
    } catch (const std::exception& broken) {
      ADD_FAILURE() << "input " << i << ": " << broken.what();
    }
  }
}

}  // namespace
}  // namespace sckf::test
