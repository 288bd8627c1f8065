#include <cmath>
#include <set>

#include "base/error.hpp"
#include "record/csv.hpp"
#include "record/look.hpp"
#include "record/units.hpp"

namespace ulna {
namespace {

std::vector<Column> columns_of(const std::vector<std::string>& headings) {
  std::vector<Column> columns;
  std::set<std::string> seen;
  for (const std::string& text : headings) {
    Heading heading = parse_heading(text);
    if (!seen.insert(text).second || text.empty()) {
      throw Error(Fault::kFormat, "headings",
                  text.empty() ? "a column has no name: give every column one"
                               : "two columns are named \"" + text + "\": rename one",
                  "column " + text);
    }
    columns.push_back({text, std::move(heading.stem), std::move(heading.unit)});
  }
  return columns;
}

}  // namespace

ReadResult from_columns(MatrixRef values, const std::vector<std::string>& headings,
                        const CsvOptions& options, Token* token) {
  require(static_cast<Index>(headings.size()) == values.cols(), "headings",
          "there are " + std::to_string(values.cols()) + " columns of values but " +
              std::to_string(headings.size()) + " headings: give one a column");
  require(std::isfinite(options.map.rate_hz) && options.map.rate_hz >= 0.0, "rate_hz",
          "rate_hz must be positive, or 0 for a time column");
  const std::vector<Column> columns = columns_of(headings);
  Mapping mapping = map_columns(columns, options.map);
  if (mapping.time < 0 && !(options.map.rate_hz > 0.0)) {
    throw Error(Fault::kArgument, "time",
                "no column is called time (the columns are " + list_of(columns) +
                    "): name the time column in a map, or give rate_hz");
  }
  Source source;
  source.header = true;
  Record::Parts parts;
  if (mapping.time >= 0) {
    const Column& clock = columns[static_cast<std::size_t>(mapping.time)];
    source.time_column = clock.heading;
    source.time_unit = !options.map.time_unit.empty() ? options.map.time_unit
                       : clock.unit.empty()           ? "s"
                                                      : clock.unit;
    const Vector seconds = mapping.time_factor * values.col(mapping.time);
    parts.time.assign(seconds.data(), seconds.data() + seconds.size());
  }
  parts.values.resize(values.rows(), static_cast<Index>(mapping.columns.size()));
  for (std::size_t c = 0; c < mapping.columns.size(); ++c) {
    step(token, 0.9 * static_cast<double>(c) / static_cast<double>(mapping.columns.size()));
    parts.values.col(static_cast<Index>(c)) = values.col(mapping.columns[c]);
    if (mapping.factors[c] != 1.0) parts.values.col(static_cast<Index>(c)) *= mapping.factors[c];
  }
  parts.channels = std::move(mapping.channels);
  parts.rate_hz = options.map.rate_hz;
  parts.provenance.push_back("read " + (options.name.empty() ? "arrays" : options.name) + ": " +
                             std::to_string(values.rows()) + " rows, " +
                             std::to_string(parts.values.cols()) + " channels");
  Record record = Record::make(std::move(parts));
  std::vector<Finding> findings = std::move(mapping.findings);
  const std::vector<Finding> seen = look(record, token);
  findings.insert(findings.end(), seen.begin(), seen.end());
  return {std::move(record), std::move(findings), std::move(source)};
}

}  // namespace ulna
