#include "record/csv.hpp"

#include <unistd.h>

#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "text.hpp"

namespace ulna {
namespace {

// Rows of (t, x, F) in the given signs, t in steps of 1 ms.
std::string table(const std::string& heading, char delimiter, char decimal, int rows = 5) {
  std::string text = heading;
  for (int i = 0; i < rows; ++i) {
    std::string line = "0.00" + std::to_string(i) + "|-1.5e-3|" + std::to_string(i) + ".25\n";
    for (char& c : line) c = c == '.' ? decimal : c == '|' ? delimiter : c;
    text += line;
  }
  return text;
}

void expect_table(const ReadResult& read, int rows = 5) {
  ASSERT_EQ(read.record.rows(), rows);
  ASSERT_EQ(read.record.channel_count(), 2);
  EXPECT_EQ(read.record.time()[3], 0.003);
  EXPECT_EQ(read.record.values()(2, 0), -1.5e-3);
  EXPECT_EQ(read.record.values()(4, 1), 4.25);
  EXPECT_EQ(read.record.rate_hz(), 1000.0);
}

TEST(Csv, DetectsDelimiterAndDecimal) {
  for (const char delimiter : {',', ';', '\t', ' ', '|'}) {
    for (const char decimal : {'.', ','}) {
      if (delimiter == decimal) continue;
      const std::string d(1, delimiter);
      const ReadResult read = read_text(table("t" + d + "x" + d + "F_x\n", delimiter, decimal));
      SCOPED_TRACE(d + decimal);
      expect_table(read);
      EXPECT_EQ(read.source.delimiter, delimiter);
      EXPECT_EQ(read.source.decimal, decimal);
    }
  }
}

TEST(Csv, ReadsUnitsInHeadingsAndRows) {
  const ReadResult brackets = read_text("t [ms],x [mm],F_x (N)\n0,1,2\n1,3,4\n");
  const ReadResult row = read_text("t,x,F_x\nms,mm,N\n0,1,2\n1,3,4\n");
  const ReadResult bracketed_row = read_text("t,x,F_x\n[ms],[mm],[N]\n0,1,2\n1,3,4\n");
  for (const ReadResult* read : {&brackets, &row, &bracketed_row}) {
    EXPECT_EQ(read->record.time()[1], 1e-3);
    EXPECT_EQ(read->record.values()(1, 0), 3e-3);
    EXPECT_EQ(read->record.channels()[0].unit, "m");
    EXPECT_EQ(read->record.channels()[0].source_unit, "mm");
  }
}

TEST(Csv, ForgivesFormalities) {
  expect_table(read_text(std::string("\xEF\xBB\xBF").append(table("t,x,F_x\n", ',', '.'))));
  expect_table(read_text(table("# lab 3\n% more\n// and more\n\nt,x,F_x\n", ',', '.')));
  expect_table(read_text(table("# t,x,F_x\n", ',', '.')));
  expect_table(read_text(table("\"t\",\"x\", \"F_x\" \n", ',', '.')));
  expect_table(read_text(table("Subject 3\nDate: 2020-01-01\nt,x,F_x\n", ',', '.')));
  std::string crlf = table("t,x,F_x\n", ',', '.'), cr = crlf, trailing = crlf;
  for (std::size_t at = 0; (at = crlf.find('\n', at)) != std::string::npos; at += 2)
    crlf.insert(at, 1, '\r');
  for (char& c : cr) c = c == '\n' ? '\r' : c;
  for (std::size_t at = 0; (at = trailing.find('\n', at)) != std::string::npos; at += 2)
    trailing.insert(at, 1, ',');
  expect_table(read_text(crlf));
  expect_table(read_text(cr));
  expect_table(read_text(trailing));
  std::string unfinished = table("t,x,F_x\n", ',', '.');
  unfinished.pop_back();
  const ReadResult read = read_text(unfinished);
  expect_table(read);
  EXPECT_FALSE(has(read.findings, "truncated"));
}

TEST(Csv, KeepsMissingValuesAsNan) {
  const ReadResult read = read_text("t,x,F_x\n0,1,\n1,,2\n2,nan,-\n3,NaN,NA\n4,+5,6\n");
  const Matrix& v = read.record.values();
  EXPECT_TRUE(std::isnan(v(0, 1)) && std::isnan(v(1, 0)) && std::isnan(v(2, 0)) &&
              std::isnan(v(2, 1)) && std::isnan(v(3, 0)) && std::isnan(v(3, 1)));
  EXPECT_EQ(v(4, 0), 5.0);
  EXPECT_TRUE(has(read.findings, "nan", "x"));
}

TEST(Csv, KeepsAnIncompleteLastLineOutAndSaysSo) {
  const std::string whole = table("t,x,F_x\n", ',', '.');
  for (const char* rest : {"0.005,-1.5", "0.005", "0.005,1,", "0.005,1,2e", "0.005,1,-"}) {
    const ReadResult read = read_text(whole + rest);
    expect_table(read);
    ASSERT_TRUE(has(read.findings, "truncated")) << rest;
    EXPECT_NE(read.findings[0].message.find("line 7"), std::string::npos);
  }
}

TEST(Csv, RefusesWithOneClearSentence) {
  struct Case {
    std::string text;
    std::string sentence;  // part of it
    Fault fault;
  };
  using std::string;
  const Case cases[] = {
      {"", "the file is empty", Fault::kFormat},
      {"  \n# only this\n\n", "holds no table", Fault::kFormat},
      {string("\0\1\2\3abc", 7), "binary (a zero byte at offset 0)", Fault::kFormat},
      {"\1\2\3\4\5\6", "binary", Fault::kFormat},
      {"MATLAB 5.0 MAT-file", "MATLAB file", Fault::kFormat},
      {"\x89HDF\r\n\x1a\n", "HDF5 file", Fault::kFormat},
      {"PK\3\4", "zip archive", Fault::kFormat},
      {string("\xFF\xFEt\0", 4), "UTF-16", Fault::kFormat},
      {"t,x,F_x\n", "heading (\"t,x,F_x\") but no rows of data", Fault::kFormat},
      {"t,x,F_x\ns,m,N\n", "no rows of data", Fault::kFormat},
      {"t,x,F_x", "no rows of data", Fault::kFormat},
      {"t:x:F\n0:1:2\n1:2:3\n", "only one column of text", Fault::kFormat},
      {"t,x,F_x\n0;1;2\n1;2;3\n", "\"t,x,F_x\" is separated by another sign than the rows",
       Fault::kFormat},
      {"t,x\n0,1,2\n1,2,3\n", "the heading (line 1) has 2 names, but the rows have 3 cells",
       Fault::kFormat},
      {"t,x,x\n0,1,2\n1,2,3\n", "columns 2 and 3 are both named \"x\"", Fault::kFormat},
      {"t,x,F_x\n0,1,2\n1,2\n2,3,4\n", "line 3 has 2 cells where 3 are expected", Fault::kFormat},
      {"t,x,F_x\n0,1,2\n1,2,3,4\n2,3,4\n", "line 3 has 4 cells where 3 are expected",
       Fault::kFormat},
      {"t,x,F_x\n0,1,2\n1,abc,3\n2,3,4\n", "line 3, column \"x\" holds the text \"abc\"",
       Fault::kFormat},
      {"t,x,F_x\n0,1,2\n1,1e999,3\n2,3,4\n", "column \"x\" holds the text \"1e999\"",
       Fault::kFormat},
      {"0,oops,2\n1,2,3\n2,3,4\n", "holds the text \"oops\"", Fault::kFormat},
      {"t,x,F_x\n0,1,2\n2,2,3\n1,3,4\n",
       "line 4: the time (column \"t\") goes back from 2 s to 1 s", Fault::kData},
      {"t,x,F_x\n#\n0,1,2\n\n1,2,3\n#\n1,3,4\n", "line 7: the time (column \"t\") repeats 1 s",
       Fault::kData},
      {"t,x,F_x\n0,1,2\n,2,3\n1,3,4\n", "line 3: the time (column \"t\") is no number",
       Fault::kData},
      {"x,F_x\n1,2\n2,3\n", "no column is called time (the columns are x, F_x)", Fault::kArgument},
      {"0,1,2\n1,2,3\n", "the columns are c1, c2, c3", Fault::kArgument},
  };
  for (const Case& c : cases) {
    Fault fault = Fault::kInternal;
    const string sentence = refusal(c.text, {}, &fault);
    EXPECT_NE(sentence.find(c.sentence), string::npos)
        << "said: " << sentence << "\nwanted: " << c.sentence;
    EXPECT_EQ(fault, c.fault) << sentence;
    EXPECT_EQ(sentence.find('\n'), string::npos);
  }
}

TEST(Csv, WrongDelimiterIsNamed) {
  CsvOptions options;
  options.delimiter = ',';
  const std::string sentence = refusal("t;x;F_x\n0;1;2\n1;2;3\n", options);
  EXPECT_NE(sentence.find("holds a semicolon: set the delimiter to it"), std::string::npos)
      << sentence;
}

TEST(Csv, ObeysOptions) {
  CsvOptions options;
  options.skip_rows = 2;
  options.header = Header::kAbsent;
  options.map.time_column = "c1";
  expect_table(read_text(table("junk\nmore,junk,\n", ',', '.'), options));
  options = {};
  options.map.rate_hz = 100.0;
  const ReadResult read = read_text("t,x,F_x\n0,1,2\n0,2,3\n", options);
  EXPECT_EQ(read.record.time()[1], 0.01);
  EXPECT_EQ(read.record.channel_count(), 3);  // the column t is kept
  options.delimiter = 'x';
  EXPECT_NE(refusal("t,x\n0,1\n", options), "");
  options = {};
  options.delimiter = options.decimal = ',';
  EXPECT_NE(refusal("t,x\n0,1\n", options), "");
}

TEST(Csv, CancelsWithinALongText) {
  Token token;
  token.cancel();
  const std::string text = table("t,x,F_x\n", ',', '.');
  EXPECT_THROW(read_csv_memory(text.data(), text.size(), {}, &token), Error);
}

TEST(Csv, FilesThatCannotBeRead) {
  for (const char* path : {"/no/such/file.csv", "/tmp"}) {
    try {
      read_csv(path);
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.fault(), Fault::kFile);
      EXPECT_NE(std::string(error.what()).find(path), std::string::npos);
    }
  }
}

class Written : public ::testing::Test {
 protected:
  // Of its own for each test: they run at the same time.
  std::string path = ::testing::TempDir() + "ulna_written_" +
                     ::testing::UnitTest::GetInstance()->current_test_info()->name() + "_" +
                     std::to_string(::getpid()) + ".csv";
  void TearDown() override { std::filesystem::remove(path); }
};

Channel plain(const char* name) {
  Channel channel;
  channel.name = name;
  channel.unit = "m";
  return channel;
}

TEST_F(Written, ACancelledCallLeavesWhatWasThere) {
  std::ofstream(path) << "what was there";
  Record::Parts parts;
  parts.values = Matrix::Zero(40000, 3);
  parts.rate_hz = 1000.0;
  parts.channels = {plain("x"), plain("y"), plain("z")};
  Token token;
  token.cancel();
  EXPECT_THROW(write_csv(Record::make(parts), path, &token), Error);
  std::string text;
  std::getline(std::ifstream(path), text);
  EXPECT_EQ(text, "what was there");
  EXPECT_FALSE(std::filesystem::exists(path + ".part"));
}

TEST_F(Written, ALinkStaysALink) {
  const std::string link = path + ".link";
  std::ofstream(path) << "old";
  std::filesystem::remove(link);
  std::filesystem::create_symlink(path, link);
  Record::Parts parts;
  parts.values = Matrix::Zero(3, 1);
  parts.rate_hz = 1.0;
  parts.channels = {plain("x")};
  write_csv(Record::make(parts), link);
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_EQ(read_csv(path).record.rows(), 3);
  std::filesystem::remove(link);
}

TEST_F(Written, ReadsBackBitForBit) {
  Record::Parts parts;
  const Index rows = 300;
  parts.values = Matrix::Random(rows, 3) * 1e-3;
  parts.values(5, 1) = std::numeric_limits<double>::quiet_NaN();
  parts.values(6, 1) = -0.0;
  parts.values(7, 1) = std::numeric_limits<double>::denorm_min();
  parts.values(8, 1) = std::numeric_limits<double>::max();
  for (Index i = 0; i < rows; ++i) parts.time.push_back(static_cast<double>(i % 100) / 3.0);
  parts.trials = {{0, 100}, {100, 200}, {200, 300}};
  parts.segments = {{10, 20, 0}, {110, 150, 1}};
  parts.channels = {{"x_mm", "m", "hand; % frame", -1, Role::kPosition, 0, "raw;x", "mm"},
                    {"F, \"quoted\"", "N", "", 1, Role::kForce, 0, "", ""},
                    {"odd", "", "", 1, Role::kOther, 0, "odd", ""}};
  parts.provenance = {"made for a test", "twice"};
  const Record record = Record::make(parts);
  write_csv(record, path);
  const ReadResult read = read_csv(path);
  ASSERT_EQ(read.record.rows(), rows);
  EXPECT_EQ(read.record.rate_hz(), record.rate_hz());
  for (Index i = 0; i < rows; ++i) {
    const auto at = static_cast<std::size_t>(i);
    EXPECT_EQ(read.record.time()[at], record.time()[at]);
    for (Index c = 0; c < 3; ++c) {
      const double a = record.values()(i, c), b = read.record.values()(i, c);
      EXPECT_TRUE(std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b) ||
                  (std::isnan(a) && std::isnan(b)));
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    const Channel &a = record.channels()[c], &b = read.record.channels()[c];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.unit, b.unit);
    EXPECT_EQ(a.frame, b.frame);
    EXPECT_EQ(a.sign, b.sign);
    EXPECT_EQ(a.role, b.role);
    EXPECT_EQ(a.source_name, b.source_name);
    EXPECT_EQ(a.source_unit, b.source_unit);
  }
  ASSERT_EQ(read.record.trials().size(), 3u);
  ASSERT_EQ(read.record.segments().size(), 2u);
  EXPECT_EQ(read.record.segments()[1].trial, 1);
  EXPECT_EQ(read.record.provenance()[0], "made for a test");
  EXPECT_EQ(read.record.provenance().size(), 3u);  // and the line of reading
}

TEST_F(Written, ChunkBordersDoNotMatter) {
  // Three times the reader's buffer, so that lines straddle its borders.
  std::ofstream file(path, std::ios::binary);
  file << "t,x,F_x\n";
  const int rows = 150000;
  for (int i = 0; i < rows; ++i)
    file << i << ".0e-3," << i << ".125,"
         << "-" << i << ".5\n";
  file.close();
  const ReadResult read = read_csv(path);
  ASSERT_EQ(read.record.rows(), rows);
  for (int i = 0; i < rows; ++i) {
    ASSERT_EQ(read.record.values()(i, 0), i + 0.125) << i;
    ASSERT_EQ(read.record.values()(i, 1), -i - 0.5) << i;
  }
}

TEST(Csv, ReadsTheAnkleRecordings) {
  for (const char* name : {"ankle-a.csv", "ankle-b.csv", "ankle-c.csv"}) {
    const std::string path = std::string(ULNA_SOURCE_DIR) + "/../shared/data/ankle/" + name;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is absent";
    const ReadResult read = read_csv(path);
    EXPECT_EQ(read.record.rows(), 60000);
    EXPECT_EQ(read.record.rate_hz(), 1000.0);
    EXPECT_EQ(read.record.channels()[0].name, "position");
    EXPECT_EQ(read.record.channels()[0].unit, "rad");
    EXPECT_EQ(read.record.channels()[1].name, "torque");
    EXPECT_EQ(read.record.channels()[1].unit, "Nm");
    for (const Finding& f : read.findings) {
      EXPECT_EQ(f.severity, Severity::kNote) << name << ": " << f.message;
    }
  }
}

}  // namespace
}  // namespace ulna
