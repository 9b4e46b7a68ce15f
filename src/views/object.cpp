// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/object.h"

#include <filesystem>
#include <stdexcept>
#include <utility>

#include "field/field.h"
#include "field/model_file.h"
#include "field/object_frame.h"
#include "field/object_metadata.h"
#include "views/object_inside.h"

namespace nerf_pose_refiner {

Object::Object(std::shared_ptr<const Field> field) : field_(std::move(field)) {
  if (!field_) throw std::invalid_argument("Object: the field is null");
}

const std::string& Object::name() const { return field_->metadata.name; }

bool Object::hasScale() const { return field_->metadata.metres_per_unit > 0; }

double Object::diameter() const {
  return ObjectFrame::ofUsers(field_->metadata).lengthPerUnit() * field_->metadata.diameter;
}

Eigen::Vector3d Object::centre() const {
  return ObjectFrame::ofUsers(field_->metadata).point(field_->metadata.centre);
}

std::array<Eigen::Vector3d, 8> Object::boxCorners() const {
  return nerf_pose_refiner::boxCorners(*field_, ObjectFrame::ofUsers(field_->metadata));
}

Symmetries Object::symmetries() const {
  const FieldMetadata& object = field_->metadata;
  return object.symmetries.inFrame(object.T_O_U.inverse())
      .scaled(ObjectFrame::ofUsers(object).lengthPerUnit());
}

double Object::psnr_db() const { return field_->metadata.psnr_db; }

Object loadObject(const std::string& path) {
  return ObjectInside::make(std::make_shared<const Field>(loadField(path)));
}

void saveObject(const Object& object, const std::string& path) {
  const Field& field = *ObjectInside::field(object);
  const ObjectMetadata known = metadataBesideModel(field.metadata);
  const std::string beside = metadataPathOf(path);
  if (!sameFrame(known, readObjectMetadata(beside))) {
    if (std::filesystem::exists(beside)) {
      throw std::runtime_error("cannot save '" + path + "': '" + beside +
                               "' has another frame, box or symmetries; remove it, or choose "
                               "another name");
    }
    writeObjectMetadata(known, beside);
  }
  saveModel(field, path);
}

}  // namespace nerf_pose_refiner
