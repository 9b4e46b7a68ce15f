// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "detection/template_view.h"

namespace nerf_pose_refiner {

struct Field;

/// Tells apart fields and settings whose banks differ.
std::uint64_t templateKey(const Field& field, const TemplateBankSettings& settings);

/// Writes a bank whole or not at all. @param key of what it was made from.
/// @throws std::runtime_error naming the path and the system's reason.
void saveTemplates(const TemplateBank& bank, std::uint64_t key, const std::string& path);

/// Reads a bank; nothing if there is no such file, if it was made from something else, or if the
/// file is damaged: it can be made again.
std::optional<TemplateBank> loadTemplates(const std::string& path, std::uint64_t key);

}  // namespace nerf_pose_refiner
