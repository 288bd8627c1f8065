// Bushings over the stiffness of the tissue: exact at its levels, between them in between, refused
// beyond.
#include "plant/soft/bushing_table.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

ReductionOptions brief_reduction() {
  ReductionOptions o;
  o.settling = 0.2;
  o.ramp = 0.1;
  o.hold = 0.1;
  return o;
}

SoftScene scene_of(double upper, double fore) {
  SoftScene scene = SoftScene::of(ExoScene());
  scene.interfaces[0].tissue.stiffness = upper;
  scene.interfaces[1].tissue.stiffness = fore;
  return scene;
}

const BushingTable& table() {
  static const BushingTable kTable(SoftScene::of(ExoScene()), 200.0, 800.0, 3, brief_reduction(),
                                   2);
  return kTable;
}

TEST(BushingTable, LevelsAreEvenInTheirLogarithms) {
  ASSERT_EQ(table().levels().size(), 3u);
  EXPECT_EQ(table().levels()[0], 200.0);
  EXPECT_NEAR(table().levels()[1], 400.0, 1e-9);
  EXPECT_EQ(table().levels()[2], 800.0);
}

TEST(BushingTable, IsTheReductionAtItsLevels) {
  for (const double level : {200.0, 800.0}) {
    const std::vector<Bushing> exact =
        reduce(SoftPlant(scene_of(level, level)), brief_reduction()).bushings;
    const std::vector<Bushing> found = table().at({level, level});
    ASSERT_EQ(found.size(), exact.size());
    for (std::size_t b = 0; b < exact.size(); ++b) {
      EXPECT_EQ(found[b].name, exact[b].name);
      // Interpolated by a share of 0 or 1: to rounding.
      EXPECT_LT((found[b].stiffness - exact[b].stiffness).norm(),
                1e-12 * exact[b].stiffness.norm());
      EXPECT_LT((found[b].preload - exact[b].preload).norm(), 1e-12 * exact[b].preload.norm());
    }
  }
}

TEST(BushingTable, EachInterfaceByItselfAndBetweenItsNeighbours) {
  const std::vector<Bushing> low = table().at({200.0, 200.0});
  const std::vector<Bushing> mixed = table().at({200.0, std::sqrt(400.0 * 800.0)});
  const std::vector<Bushing> middle = table().at({400.0, 400.0});
  const std::vector<Bushing> high = table().at({800.0, 800.0});
  for (std::size_t b = 0; b < mixed.size(); ++b) {
    EXPECT_NO_THROW(mixed[b].check());
    const Matrix6 wanted = mixed[b].interface == 0
                               ? low[b].stiffness
                               : Matrix6(0.5 * (middle[b].stiffness + high[b].stiffness));
    EXPECT_LT((mixed[b].stiffness - wanted).norm(), 1e-9 * wanted.norm()) << mixed[b].name;
  }
}

// Half way between two levels (a factor of two apart) the plant itself is met to a few percent.
TEST(BushingTable, IsNearTheReductionBetweenItsLevels) {
  const double between = std::sqrt(200.0 * 400.0);
  const std::vector<Bushing> exact =
      reduce(SoftPlant(scene_of(between, between)), brief_reduction()).bushings;
  const std::vector<Bushing> found = table().at({between, between});
  for (std::size_t b = 0; b < exact.size(); ++b) {
    EXPECT_LT((found[b].stiffness - exact[b].stiffness).norm(), 0.1 * exact[b].stiffness.norm())
        << exact[b].name;
  }
}

TEST(BushingTable, RefusesWhatLiesBeyond) {
  const auto refuse = [](const auto& call, const char* words) {
    try {
      call();
      ADD_FAILURE() << "nothing was thrown: " << words;
    } catch (const Error& error) {
      EXPECT_EQ(error.fault(), Fault::kArgument);
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  refuse([] { table().at({199.0, 400.0}); }, "lies beyond the table");
  refuse([] { table().at({400.0, 801.0}); }, "lies beyond the table");
  refuse([] { table().at({400.0, std::nan("")}); }, "lies beyond the table");
  refuse([] { table().at({400.0}); }, "each interface");
  const SoftScene scene = SoftScene::of(ExoScene());
  refuse([&] { BushingTable(scene, 0.0, 800.0, 3); }, "from above 0 upwards");
  refuse([&] { BushingTable(scene, 800.0, 200.0, 3); }, "from above 0 upwards");
  refuse([&] { BushingTable(scene, 200.0, std::nan(""), 3); }, "from above 0 upwards");
  refuse([&] { BushingTable(scene, 200.0, 800.0, 1); }, "between 2 and 100");
  Token token;
  token.cancel();
  EXPECT_THROW(BushingTable(scene, 200.0, 800.0, 3, {}, 1, &token), Error);
}

}  // namespace
}  // namespace ulna
