#include "apps/batch/table.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

std::string Shown(const std::optional<double>& value, const char* format) {
  return value ? FormatNumber(format, *value) : "";
}

std::string Shown(const std::optional<std::int64_t>& value) {
  return value ? std::to_string(*value) : "";
}

// Quoted where a comma, quote or line end would be taken for the table's own.
std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string HtmlText(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string Cell(const std::string& value) {
  return "<td>" + (value.empty() ? std::string("&ndash;") : value) + "</td>";
}

// A figure over the sequences that are done and have it: their median, or the worst of them.
template <class Value>
std::optional<Value> Over(const std::vector<BatchResult>& results,
                          std::optional<Value> BatchResult::*figure,
                          bool worst_is_least,
                          bool is_median) {
  std::vector<Value> values;
  for (const BatchResult& result : results) {
    if (result.status == "done" && result.*figure) values.push_back(*(result.*figure));
  }
  if (values.empty()) return std::nullopt;
  std::sort(values.begin(), values.end());
  if (!is_median) return worst_is_least ? values.front() : values.back();
  const std::size_t middle = values.size() / 2;
  if (values.size() % 2 != 0) return values[middle];
  return static_cast<Value>((values[middle - 1] + values[middle]) / 2);
}

// Two lines over all sequences, under names that none of them can have.
std::vector<BatchResult> SummaryOf(const std::vector<BatchResult>& results) {
  const auto num_done = std::count_if(
      results.begin(), results.end(), [](const BatchResult& one) { return one.status == "done"; });
  const auto num_failed = std::count_if(results.begin(), results.end(), [](const BatchResult& one) {
    return one.status == "failed";
  });
  std::vector<BatchResult> summary;
  for (const bool is_median : {true, false}) {
    BatchResult& row = summary.emplace_back();
    row.name = is_median ? "(median)" : "(worst)";
    row.frames = Over(results, &BatchResult::frames, true, is_median);
    row.coverage = Over(results, &BatchResult::coverage, true, is_median);
    row.rpe1_deg = Over(results, &BatchResult::rpe1_deg, false, is_median);
    row.rpen_deg = Over(results, &BatchResult::rpen_deg, false, is_median);
    row.ate = Over(results, &BatchResult::ate, false, is_median);
    row.points = Over(results, &BatchResult::points, true, is_median);
    row.cpu_s = Over(results, &BatchResult::cpu_s, false, is_median);
    row.status = is_median
                     ? std::to_string(num_done) + " of " + std::to_string(results.size()) + " done"
                     : std::to_string(num_failed) + " failed";
  }
  return summary;
}

std::string HtmlRow(const BatchResult& result) {
  std::string row =
      "<tr class=\"" + std::string(result.status == "done" ? "done" : "other") + "\">";
  const std::string name = HtmlText(result.name);
  row += "<th scope=\"row\">" +
         (result.report.empty() ? name
                                : "<a href=\"" + HtmlText(result.report) + "\">" + name + "</a>") +
         "</th>";
  row += Cell(Shown(result.frames)) +
         Cell(result.coverage ? FormatNumber("%.1f", 100.0 * *result.coverage) : "");
  row += Cell(Shown(result.rpe1_deg, "%.4f")) + Cell(Shown(result.rpen_deg, "%.4f"));
  row += Cell(Shown(result.ate, "%.4f")) + Cell(Shown(result.points));
  row += Cell(Shown(result.cpu_s, "%.1f"));
  const std::string status = HtmlText(result.status);
  row += "<td class=\"status\">" +
         (result.status == "done" || result.log.empty()
              ? status
              : "<a href=\"" + HtmlText(result.log) + "\">" + status + "</a>") +
         (result.note.empty() ? "" : ": " + HtmlText(result.note)) + "</td></tr>\n";
  return row;
}

constexpr const char* kPageHead = R"html(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<style>
:root { --ink: #1b1f24; --faint: #667; --paper: #fff; --line: #d5d8dd; --alert: #b3261e; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e6ea; --faint: #9aa0aa; --paper: #15181c; --line: #363b43; --alert: #ff8a80; }
}
body { margin: 2rem; color: var(--ink); background: var(--paper); font: 15px/1.45 system-ui, sans-serif; }
h1 { font-size: 1.2rem; }
p { color: var(--faint); }
.table { overflow-x: auto; }
table { border-collapse: collapse; border-block: 2px solid var(--ink); font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .8rem; text-align: right; white-space: nowrap; }
thead th { border-bottom: 1px solid var(--ink); }
tfoot tr:first-child > * { border-top: 1px solid var(--ink); }
tfoot .status { color: inherit; }
tbody tr + tr > * { border-top: 1px solid var(--line); }
tbody th, tfoot th { font-weight: 600; }
a { color: inherit; }
th:first-child, th:last-child, .status { text-align: left; }
.status { white-space: normal; min-width: 8rem; }
.other .status { color: var(--alert); }
</style>
)html";

constexpr const char* kTableHead =
    "<div class=\"table\"><table>\n<thead><tr><th>sequence</th><th>frames</th><th>coverage, %</th>"
    "<th>RPE<sub>1</sub>, deg</th><th>RPE<sub>n</sub>, deg</th><th>ATE, m</th><th>points</th>"
    "<th>CPU, s</th><th>status</th></tr></thead>\n<tbody>\n";

}  // namespace

std::string ResultsCsv(const std::vector<BatchResult>& results) {
  std::string csv = "name,frames,coverage,rpe1_deg,rpen_deg,ate_m,points,cpu_s,status,note\n";
  std::vector<BatchResult> rows = results;
  for (BatchResult& row : SummaryOf(results)) rows.push_back(std::move(row));
  for (const BatchResult& result : rows) {
    csv += CsvField(result.name) + "," + Shown(result.frames) + "," +
           Shown(result.coverage, "%.4f") + "," + Shown(result.rpe1_deg, "%.12g") + "," +
           Shown(result.rpen_deg, "%.12g") + "," + Shown(result.ate, "%.12g") + "," +
           Shown(result.points) + "," + Shown(result.cpu_s, "%.2f") + "," +
           CsvField(result.status) + "," + CsvField(result.note) + "\n";
  }
  return csv;
}

std::string ResultsHtml(const std::vector<BatchResult>& results, const std::string& title) {
  const auto num_done =
      std::count_if(results.begin(), results.end(), [](const BatchResult& result) {
        return result.status == "done";
      });
  std::string page = kPageHead;
  page += "<title>" + HtmlText(title) + "</title>\n</head>\n<body>\n<h1>" + HtmlText(title) +
          "</h1>\n<p>" + std::to_string(num_done) + " of " + std::to_string(results.size()) +
          " sequences done. Coverage: share of the frames whose pose has ground truth. "
          "RPE<sub>1</sub>: root mean square from frame to frame; RPE<sub>n</sub>: mean over all "
          "steps; ATE: root mean square after the best similarity. The same figures stand in "
          "results.csv.</p>\n";
  page += kTableHead;
  for (const BatchResult& result : results) page += HtmlRow(result);
  page += "</tbody>\n<tfoot>\n";
  for (const BatchResult& result : SummaryOf(results)) page += HtmlRow(result);
  return page + "</tfoot>\n</table></div>\n</body>\n</html>\n";
}

}  // namespace rotslam
