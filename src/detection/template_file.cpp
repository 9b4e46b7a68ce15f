// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "detection/field_checksum.h"
#include "files/atomic_file.h"
#include "files/input_file.h"

namespace nerf_pose_refiner {
namespace {

constexpr char kTemplateFormat[8] = {'N', 'P', 'R', 'T', 'P', 'L', '0', '1'};
constexpr std::uint32_t kMaxViews = 10000;
constexpr int kViewNumbers = 9;  // of R_O_V, column by column
constexpr int kFeatureNumbers = 4;

struct TemplateHeader {
  char format[8];
  std::uint64_t key;
  std::uint64_t checksum;  // of all that follows
  std::uint32_t views;
  std::uint32_t features;  // of each view that has any
};

/// The numbers of a view: its axes, whether it has features, and these.
void write(const TemplateView& view, std::uint32_t features, std::vector<double>* numbers) {
  numbers->insert(numbers->end(), view.R_O_V.data(), view.R_O_V.data() + kViewNumbers);
  numbers->push_back(view.features.empty() ? 0 : 1);
  for (std::uint32_t i = 0; i < features; ++i) {
    const TemplateFeature feature =
        view.features.empty() ? TemplateFeature{{0, 0, 0}, 0} : view.features[i];
    for (const float number :
         {feature.point.x(), feature.point.y(), feature.point.z(), feature.normal_rad}) {
      numbers->push_back(number);
    }
  }
}

std::uint64_t checksumOf(const TemplateHeader& header, const std::vector<double>& numbers) {
  Checksum checksum;
  addTo(header.views, &checksum);
  addTo(header.features, &checksum);
  checksum.add(numbers.data(), numbers.size() * sizeof(double));
  return checksum.value();
}

TemplateView viewOf(const double* numbers, std::uint32_t features) {
  TemplateView view;
  std::copy_n(numbers, kViewNumbers, view.R_O_V.data());
  if (numbers[kViewNumbers] == 0) return view;
  const double* feature = numbers + kViewNumbers + 1;
  for (std::uint32_t i = 0; i < features; ++i, feature += kFeatureNumbers) {
    view.features.push_back({Eigen::Vector3d(feature[0], feature[1], feature[2]).cast<float>(),
                             static_cast<float>(feature[3])});
  }
  return view;
}

TemplateBank readBank(const InputFile& file, std::uint64_t key) {
  TemplateHeader header;
  file.read(0, &header, sizeof header);
  const std::size_t of_view = kViewNumbers + 1 + std::size_t{kFeatureNumbers} * header.features;
  if (std::memcmp(header.format, kTemplateFormat, sizeof kTemplateFormat) != 0 ||
      header.key != key || header.views > kMaxViews ||
      header.features > TemplateView::kMostFeatures || header.features % TemplateView::kRun != 0 ||
      file.size() != sizeof header + header.views * of_view * sizeof(double)) {
    throw std::runtime_error("no templates of this object");
  }
  std::vector<double> numbers(header.views * of_view);
  file.read(sizeof header, numbers.data(), numbers.size() * sizeof(double));
  const auto finite = [](double number) { return std::isfinite(number); };
  if (checksumOf(header, numbers) != header.checksum ||
      !std::all_of(numbers.begin(), numbers.end(), finite)) {
    throw std::runtime_error("damaged");
  }
  TemplateBank bank;
  for (std::uint32_t i = 0; i < header.views; ++i) {
    bank.views.push_back(viewOf(numbers.data() + i * of_view, header.features));
  }
  return bank;
}

}  // namespace

std::uint64_t templateKey(const Field& field, const TemplateBankSettings& settings) {
  constexpr std::uint32_t kTemplateVersion = 2;  // of how templates are made
  Checksum checksum;
  addTo(kTemplateVersion, &checksum);
  addTo(field, &checksum);
  for (const int value : {settings.views, settings.object_px, settings.features}) {
    addTo(value, &checksum);
  }
  addTo(settings.distance, &checksum);
  return checksum.value();
}

void saveTemplates(const TemplateBank& bank, std::uint64_t key, const std::string& path) {
  TemplateHeader header = {};
  std::copy_n(kTemplateFormat, sizeof kTemplateFormat, header.format);
  header.key = key;
  header.views = static_cast<std::uint32_t>(bank.views.size());
  for (const TemplateView& view : bank.views) {
    header.features = std::max(header.features, static_cast<std::uint32_t>(view.features.size()));
  }
  std::vector<double> numbers;
  for (const TemplateView& view : bank.views) write(view, header.features, &numbers);
  header.checksum = checksumOf(header, numbers);
  AtomicFile file(path);
  file.write(&header, sizeof header);
  file.write(numbers.data(), numbers.size() * sizeof(double));
  file.commit();
}

std::optional<TemplateBank> loadTemplates(const std::string& path, std::uint64_t key) {
  try {
    return readBank(InputFile(path), key);
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

}  // namespace nerf_pose_refiner
