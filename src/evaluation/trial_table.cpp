// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trial_table.h"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

constexpr const char* kKeyColumns =
    "experiment,scene,kind,method,loss,variant,condition,protocol,view,start";
constexpr std::size_t kKeyCells = 10;

std::string joined(const std::vector<std::string>& cells) {
  std::string line;
  for (std::size_t i = 0; i < cells.size(); ++i) line += (i > 0 ? "," : "") + cells[i];
  return line;
}

std::string lineOf(const TrialKey& key, const std::vector<std::string>& row) {
  std::string line;
  for (const std::string& cell : key.cells()) line += cell + ",";
  return line + joined(row) + "\n";
}

/// The first cells of a line; fewer if it has no more.
std::vector<std::string> firstCells(const std::string& line, std::size_t count) {
  std::vector<std::string> cells;
  std::istringstream stream(line);
  for (std::string cell; cells.size() < count && std::getline(stream, cell, ',');) {
    cells.push_back(cell);
  }
  return cells;
}

}  // namespace

std::vector<std::string> TrialKey::cells() const {
  return {experiment,
          scene,
          kind,
          method,
          loss,
          variant,
          condition,
          protocol,
          std::to_string(view),
          std::to_string(start)};
}

TrialTable::TrialTable(const std::string& path, const std::vector<std::string>& columns)
    : path_(path) {
  const std::string header = std::string(kKeyColumns) + "," + joined(columns) + "\n";
  if (std::filesystem::exists(path)) readExisting(header);
  const bool is_new = !std::filesystem::exists(path) || std::filesystem::file_size(path) == 0;
  file_.open(path, std::ios::binary | std::ios::app);
  if (is_new) file_ << header << std::flush;
  if (!file_) throw std::runtime_error("cannot write '" + path + "': " + std::strerror(errno));
}

void TrialTable::readExisting(const std::string& header) {
  std::ifstream file(path_, std::ios::binary);
  if (!file) throw std::runtime_error("cannot read '" + path_ + "': " + std::strerror(errno));
  std::uintmax_t whole = 0;  // bytes up to the last line's end
  for (std::string line; std::getline(file, line) && !file.eof();) {
    if (whole == 0) {
      if (line + "\n" != header) {
        throw std::runtime_error("'" + path_ + "' holds another table: its first line is '" + line +
                                 "'");
      }
    } else {
      keys_.insert(firstCells(line, kKeyCells));
    }
    whole += line.size() + 1;
  }
  file.close();
  if (whole == 0) {
    file.open(path_, std::ios::binary);
    const std::string begun{std::istreambuf_iterator<char>(file), {}};
    if (header.compare(0, begun.size(), begun) != 0) {
      throw std::runtime_error("'" + path_ + "' holds no table");
    }
    file.close();
  }
  std::filesystem::resize_file(path_, whole);
}

bool TrialTable::has(const TrialKey& key) const { return keys_.count(key.cells()) > 0; }

void TrialTable::add(const TrialKey& key, const std::vector<std::vector<std::string>>& rows) {
  std::string text;
  for (const std::vector<std::string>& row : rows) text += lineOf(key, row);
  file_ << text << std::flush;
  if (!file_) throw std::runtime_error("cannot write '" + path_ + "': " + std::strerror(errno));
  keys_.insert(key.cells());
}

std::string cellOf(double value) {
  if (!std::isfinite(value)) return "";
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

}  // namespace nerf_pose_refiner
