// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/shown_sides.h"

#include <cstddef>

#include "image/resample.h"
#include "trust/clutter_blocks.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

std::vector<ShownSide> renderSides(const LoadedField& field, const ViewBankSettings& settings,
                                   const CancellationToken& cancellation) {
  const FieldMetadata& object = field.field().metadata;
  std::vector<ShownSide> sides;
  for (const View& view : viewsOf(object, settings)) {
    const RenderedWindow window = renderWindow(field, view, settings.keyframe, cancellation);
    const Image &colour = window.rendering.colour, &alpha = window.rendering.alpha;
    const Camera rendered = window.camera.resized(alpha.width, alpha.height);
    sides.push_back(
        {std::make_shared<const KeyframePoints>(keyframeOf(window, object, settings.keyframe)),
         resample(colour, rendered, view.camera), resample(alpha, rendered, view.camera)});
  }
  return sides;
}

Image beforeClutter(const ShownSide& side, std::uint64_t index) {
  Image image = side.colour;
  const Image behind = clutterBlocks(side.points->camera, index);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] += (1 - side.alpha.values[i / 3]) * behind.values[i];
  }
  return image;
}

}  // namespace nerf_pose_refiner
