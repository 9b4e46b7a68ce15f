// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/param_reader.h"

#include <ros/param.h>

#include <algorithm>
#include <numeric>
#include <sstream>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

using XmlRpc::XmlRpcValue;

const char* typeName(XmlRpcValue::Type type) {
  switch (type) {
    case XmlRpcValue::TypeBoolean:
      return "a boolean";
    case XmlRpcValue::TypeInt:
      return "a whole number";
    case XmlRpcValue::TypeDouble:
      return "a number";
    case XmlRpcValue::TypeString:
      return "a string";
    case XmlRpcValue::TypeArray:
      return "a list";
    case XmlRpcValue::TypeStruct:
      return "a group";
    default:
      return "something else";
  }
}

[[noreturn]] void throwType(const std::string& path, XmlRpcValue::Type wanted,
                            const XmlRpcValue& found) {
  throw std::invalid_argument("parameter " + path + " must be " + typeName(wanted) + ", not " +
                              typeName(found.getType()));
}

void requireType(const std::string& path, XmlRpcValue::Type wanted, const XmlRpcValue& found) {
  if (found.getType() != wanted) throwType(path, wanted, found);
}

/// Levenshtein's distance: insertions, deletions and replacements between two words.
std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0u);
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

ParamReader::ParamReader(const XmlRpcValue& values, const std::string& path)
    : values_(values), path_(path), log_(std::make_shared<std::vector<std::string>>()) {
  if (values_.valid()) requireType(path, XmlRpcValue::TypeStruct, values_);
}

ParamReader ParamReader::ofNode(const ros::NodeHandle& pnh) {
  XmlRpcValue values;
  ros::param::get(pnh.getNamespace(), values);
  return ParamReader(values, "~");
}

const XmlRpcValue* ParamReader::find(const std::string& name) {
  asked_.insert(name);
  if (!values_.valid() || !values_.hasMember(name)) return nullptr;
  return &values_[name];
}

std::string ParamReader::pathOf(const std::string& name) const {
  return path_ == "~" ? path_ + name : path_ + "/" + name;
}

template <typename T>
void ParamReader::note(const std::string& name, const T& value) {
  std::ostringstream line;
  line << std::boolalpha << pathOf(name) << ": " << value;
  log_->push_back(line.str());
}

void ParamReader::get(const std::string& name, bool& value) {
  if (const XmlRpcValue* found = find(name)) {
    requireType(pathOf(name), XmlRpcValue::TypeBoolean, *found);
    value = static_cast<const bool&>(*found);
  }
  note(name, value);
}

void ParamReader::get(const std::string& name, int& value) {
  if (const XmlRpcValue* found = find(name)) {
    requireType(pathOf(name), XmlRpcValue::TypeInt, *found);
    value = static_cast<const int&>(*found);
  }
  note(name, value);
}

void ParamReader::get(const std::string& name, double& value) {
  if (const XmlRpcValue* found = find(name)) {
    if (found->getType() == XmlRpcValue::TypeInt) {
      value = static_cast<const int&>(*found);
    } else {
      requireType(pathOf(name), XmlRpcValue::TypeDouble, *found);
      value = static_cast<const double&>(*found);
    }
  }
  note(name, value);
}

void ParamReader::get(const std::string& name, std::string& value) {
  if (const XmlRpcValue* found = find(name)) {
    requireType(pathOf(name), XmlRpcValue::TypeString, *found);
    value = static_cast<const std::string&>(*found);
  }
  note(name, value.empty() ? std::string("\"\"") : value);
}

void ParamReader::get(const std::string& name, std::uint64_t& value) {
  if (const XmlRpcValue* found = find(name)) {
    requireType(pathOf(name), XmlRpcValue::TypeInt, *found);
    const int number = static_cast<const int&>(*found);
    if (number < 0) throw std::invalid_argument("parameter " + pathOf(name) + " must be >= 0");
    value = static_cast<std::uint64_t>(number);
  }
  note(name, value);
}

std::optional<std::vector<double>> ParamReader::numbers(const std::string& name) {
  const XmlRpcValue* found = find(name);
  if (!found) return std::nullopt;
  requireType(pathOf(name), XmlRpcValue::TypeArray, *found);
  std::vector<double> result;
  std::ostringstream text;
  for (int i = 0; i < found->size(); ++i) {
    const XmlRpcValue& item = (*found)[i];
    if (item.getType() == XmlRpcValue::TypeInt) {
      result.push_back(static_cast<const int&>(item));
    } else {
      requireType(pathOf(name) + "[" + std::to_string(i) + "]", XmlRpcValue::TypeDouble, item);
      result.push_back(static_cast<const double&>(item));
    }
    text << (i > 0 ? ", " : "") << result.back();
  }
  note(name, "[" + text.str() + "]");
  return result;
}

ParamReader ParamReader::group(const std::string& name) {
  const XmlRpcValue* found = find(name);
  ParamReader reader(found ? *found : XmlRpcValue(), pathOf(name));
  reader.log_ = log_;
  return reader;
}

std::optional<std::vector<ParamReader>> ParamReader::list(const std::string& name) {
  const XmlRpcValue* found = find(name);
  if (!found) return std::nullopt;
  std::vector<ParamReader> readers;
  requireType(pathOf(name), XmlRpcValue::TypeArray, *found);
  for (int i = 0; i < found->size(); ++i) {
    readers.emplace_back((*found)[i], pathOf(name) + "[" + std::to_string(i) + "]");
    readers.back().log_ = log_;
  }
  return readers;
}

std::vector<std::string> ParamReader::unknown() const {
  std::vector<std::string> lines;
  if (!values_.valid()) return lines;
  for (const auto& entry : values_) {
    const std::string& key = entry.first;
    if (asked_.count(key)) continue;
    std::string line = "unknown parameter " + pathOf(key);
    const auto nearest = std::min_element(
        asked_.begin(), asked_.end(),
        [&](const auto& a, const auto& b) { return editDistance(key, a) < editDistance(key, b); });
    if (nearest != asked_.end()) line += ": did you mean " + pathOf(*nearest) + "?";
    lines.push_back(line);
  }
  return lines;
}

void ParamReader::rejectUnknown() const {
  std::string text;
  for (const std::string& line : unknown()) text += (text.empty() ? "" : "; ") + line;
  if (!text.empty()) throw std::invalid_argument(text);
}

}  // namespace nerf_pose_refiner
