// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "refinement/field_refiner.h"
#include "refinement/keyframe_refiner.h"

namespace nerf_pose_refiner {

/// Where to look for the object.
struct SearchRequest {
  const Observation& observation;
  Prior prior;
  bool tracked = false;       ///< the prior is the pose of the image before
  std::int64_t stamp_ns = 0;  ///< when the image was taken
};

/// What tracking asks of the library: find the object in an image. (Tests put another one in its
/// place.) One thread at a time.
class ObjectSearch {
 public:
  virtual ~ObjectSearch() = default;

  /// The object to look for from now on.
  virtual void use(std::shared_ptr<const Field> field) = 0;

  /// Searches in another way from now on.
  virtual void configure(const RefinerSettings& initial, const RefinerSettings& tracking) = 0;

  virtual Refinement search(const SearchRequest& request,
                            const CancellationToken& cancellation) = 0;
};

/// The right to use a processor that others want to use, too; it ends with this object.
class ProcessorTurn {
 public:
  virtual ~ProcessorTurn() = default;
};

/// A processor to search with.
struct SearchProcessor {
  std::shared_ptr<Backend> backend;
  /// Waits for a turn, until the token is cancelled; empty: nobody else uses the processor.
  std::function<std::unique_ptr<ProcessorTurn>(const CancellationToken&)> take_turn = {};
};

/// Finds or makes a processor: called by the thread that searches, for to look for a GPU takes
/// long.
using ProcessorFactory = std::function<SearchProcessor()>;

/// Searches with a backend: widely from an initial pose, narrowly from the last one. To follow by
/// keyframes takes no turn: their renderings are turns of their own.
class RefinerSearch : public ObjectSearch {
 public:
  /// @param find_processor called with the first object.
  RefinerSearch(ProcessorFactory find_processor, const RefinerSettings& initial,
                const RefinerSettings& tracking);

  void use(std::shared_ptr<const Field> field) override;
  void configure(const RefinerSettings& initial, const RefinerSettings& tracking) override;
  Refinement search(const SearchRequest& request, const CancellationToken& cancellation) override;

 private:
  Refinement find(const SearchRequest& request, const CancellationToken& cancellation);

  ProcessorFactory find_processor_;
  RefinerSettings initial_settings_;
  RefinerSettings tracking_settings_;
  SearchProcessor processor_;
  std::optional<FieldRefiner> initial_;
  std::optional<FieldRefiner> tracking_;
  std::shared_ptr<const LoadedField> field_;
  std::optional<KeyframeRefiner> keyframes_;  ///< of the field; nothing: not asked for yet
};

}  // namespace nerf_pose_refiner
