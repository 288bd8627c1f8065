// Frames of an MVNX file: the same numbers however the bytes are cut, and what is no MVNX refused.
#include "record/mvnx_frames.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.hpp"

namespace ulna {
namespace {

const std::string kFrames = R"(
  <frame time="0" index="" type="tpose"><orientation>1 0 0 0</orientation>
    <position>0 0 1</position></frame>
  <!-- a > b < c --><?note a > b ?>
  <frame type='normal' index="7" time="116"><orientation>1 -2.5 +3e-2 0.125</orientation>
    <velocity><inner a="&gt;>">text</inner></velocity><position>1 2 3</position></frame>
  <frame index="8"><position>4 5<!-- six -->6</position><footContacts/></frame>
  <x:frame index=" 10 " time="166" type="normal"><x:orientation>0 1 nan 1e-400</x:orientation>
    <position></position></x:frame>
</frames>)";

MvnxFrames read(const std::string& text, std::size_t cut) {
  MvnxFrames frames("a.mvnx", {"orientation", "position", "jointAngle"}, 5);
  for (std::size_t at = 0; at < text.size(); at += cut) {
    frames.push(text.data() + at, std::min(cut, text.size() - at));
  }
  return frames;
}

void expect_whole(const MvnxFrames& frames) {
  ASSERT_TRUE(frames.done());
  ASSERT_EQ(frames.frames(), 3);
  EXPECT_EQ(frames.index(), (std::vector<std::int64_t>{7, 8, 10}));
  EXPECT_EQ(frames.time_ms()[0], 116.0);
  EXPECT_TRUE(std::isnan(frames.time_ms()[1]));
  const MvnxTable& orientation = frames.tables()[0];
  ASSERT_EQ(orientation.width, 4);
  ASSERT_EQ(orientation.numbers.size(), 12u);
  EXPECT_EQ(orientation.numbers[1], -2.5);
  EXPECT_EQ(orientation.numbers[2], 0.03);
  for (int k = 4; k < 8; ++k) EXPECT_TRUE(std::isnan(orientation.numbers[k]));
  EXPECT_TRUE(std::isnan(orientation.numbers[10]));
  EXPECT_EQ(orientation.numbers[11], 0.0);
  const std::vector<double>& position = frames.tables()[1].numbers;
  EXPECT_EQ(std::vector<double>(position.begin(), position.begin() + 6),
            (std::vector<double>{1, 2, 3, 4, 5, 6}));
  EXPECT_TRUE(std::isnan(position[8]));
  EXPECT_EQ(frames.tables()[2].width, 0);
  ASSERT_EQ(frames.poses().size(), 1u);
  EXPECT_EQ(frames.poses()[0].kind, "tpose");
  EXPECT_EQ(frames.poses()[0].orientation, (std::vector<double>{1, 0, 0, 0}));
  EXPECT_EQ(frames.poses()[0].position, (std::vector<double>{0, 0, 1}));
}

TEST(MvnxFrames, AreTheSameHoweverTheBytesAreCut) {
  for (std::size_t cut = 1; cut <= kFrames.size(); ++cut) {
    SCOPED_TRACE(cut);
    const MvnxFrames frames = read(kFrames, cut);
    expect_whole(frames);
    EXPECT_EQ(frames.line(), 5 + 9);  // what follows the tag is still on the line of the last one
  }
}

TEST(MvnxFrames, LeaveWhatFollowsThem) {
  const std::string text = kFrames + "</subject></mvnx>\n";
  MvnxFrames frames("a.mvnx", {"position"}, 1);
  const std::size_t half = kFrames.size() / 2;
  EXPECT_EQ(frames.push(text.data(), half), half);
  EXPECT_FALSE(frames.done());
  EXPECT_EQ(frames.push(text.data() + half, text.size() - half), kFrames.size() - half);
  EXPECT_TRUE(frames.done());
  EXPECT_EQ(frames.push("x", 1), 0u);
}

TEST(MvnxFrames, WithoutElementsReadOnlyPoses) {
  MvnxFrames frames("a.mvnx", {}, 1);
  const std::string text = "<frame index='no number'><position>text</position></frame>" + kFrames;
  frames.push(text.data(), text.size());
  EXPECT_TRUE(frames.done());
  EXPECT_EQ(frames.frames(), 0);
  EXPECT_EQ(frames.poses().size(), 1u);
}

TEST(MvnxFrames, RefuseInWords) {
  const auto refused = [](const std::string& text, const char* words, const char* where) {
    MvnxFrames frames("a.mvnx", {"orientation", "position"}, 3);
    try {
      frames.push(text.data(), text.size());
      ADD_FAILURE() << "accepted: " << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.fault(), Fault::kFormat);
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
      EXPECT_EQ(error.detail(), where);
    }
    EXPECT_THROW(frames.push(text.data(), text.size()), Error);  // nothing more is taken
  };
  const char* const damaged = "a.mvnx breaks off or is damaged at line 4";
  refused("\n</subject>", damaged, "line 4");
  refused("\n<frame index='1'><position>1</orientation>", damaged, "line 4");
  refused("\n<frame index='1'></frames>", damaged, "line 4");
  refused("\n<frame index='1'><a><b></a>", damaged, "line 4");
  refused("\n<frame index=1></frame>", damaged, "line 4");
  refused("\n<![CDATA[<frame>]]>", damaged, "line 4");
  refused("\n< frame>", damaged, "line 4");
  refused("\n<frame <frame>", damaged, "line 4");
  refused("<frame><position>1</position></frame>", "the index '' and the time ''", "frame");
  refused("<frame index='1' time='\x1b'>", "the time '?', one of which is no number", "frame");
  refused("<frame index='1'><position>1 x</position></frame>",
          "<position> in frame 1 of a.mvnx holds text that is no number", "frame 1");
  refused("<frame index='1'><position>1 <b>2</b></position></frame>", "no number", "frame 1");
  refused("<frame type='tpose'><position>&lt;</position></frame>", "<position> in the tpose frame",
          "the tpose frame");
  refused(
      "<frame index='1'><position>1 2</position></frame>"
      "<frame index='2'><position>1 2 3</position></frame>",
      "frame 2 of a.mvnx has 3 numbers in <position>, the frames before have 2", "frame 2");
  refused(std::string((std::size_t{1} << 24) + 2, ' '), "damaged at line 3", "line 3");
  EXPECT_THROW(MvnxFrames("a", {"position", "position"}, 1), Error);
  EXPECT_THROW(MvnxFrames("a", {""}, 1), Error);
  EXPECT_THROW(MvnxFrames("a", {}, 0), Error);
}

// Bytes changed anywhere: read or refused, never anything else, and alike for every cut.
TEST(MvnxFrames, ReadOrRefuseWhateverComes) {
  std::minstd_rand random(1);
  int refused = 0;
  for (int k = 0; k < 3000; ++k) {
    std::string text = kFrames;
    for (int n = 0; n < 2; ++n) text[random() % text.size()] = static_cast<char>(random());
    std::string whole, cut;
    try {
      whole = std::to_string(read(text, text.size()).frames());
    } catch (const Error& error) {
      whole = error.what();
    }
    try {
      cut = std::to_string(read(text, 17).frames());
    } catch (const Error& error) {
      cut = error.what();
    }
    ASSERT_EQ(whole, cut) << text;
    refused += whole.find("a.mvnx") != std::string::npos ? 1 : 0;
  }
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace ulna
