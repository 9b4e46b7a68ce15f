// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/model_file.h"

#include <array>
#include <cstdint>
#include <stdexcept>

#include "field/description.h"
#include "files/atomic_file.h"
#include "files/input_file.h"
#include "files/json.h"
#include "math/checksum.h"

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "tensors are written as they lie in memory");

constexpr const char* kFormat = "nerf_pose_refiner";
constexpr int kVersion = 1;
constexpr std::uint64_t kMaxHeaderBytes = 1 << 16;  // ours have two thousand bytes

/// A tensor as the file describes it.
struct Tensor {
  const char* name;
  const char* type;
  std::vector<std::size_t> shape;
  std::size_t bytes;
};

/// The tensors of a field of this shape, in the order in which they are written.
std::array<Tensor, 4> tensorsOf(const Field& field) {
  const GridLevel last = gridLevels(field.config).back();
  const std::size_t entries = std::size_t{last.offset} + last.entries;
  const std::size_t features = static_cast<std::size_t>(field.config.features);
  const std::size_t density = densityWeightCount(field.config);
  const std::size_t colour = colourWeightCount(field.config);
  const std::size_t n = static_cast<std::size_t>(field.occupancy.resolution);
  const std::size_t occupancy = n * n * n / 8;
  return {{{"grid", "F16", {entries, features}, entries * features * sizeof(std::uint16_t)},
           {"density_weights", "F32", {density}, density * sizeof(float)},
           {"colour_weights", "F32", {colour}, colour * sizeof(float)},
           {"occupancy", "U8", {occupancy}, occupancy}}};
}

/// Over the description and all tensors, in the order in which they are written.
std::string checksumOf(const std::string& description, const Field& field) {
  Checksum checksum;
  checksum.add(description.data(), description.size());
  checksum.add(field.grid.data(), field.grid.size() * sizeof(std::uint16_t));
  checksum.add(field.density_weights.data(), field.density_weights.size() * sizeof(float));
  checksum.add(field.colour_weights.data(), field.colour_weights.size() * sizeof(float));
  checksum.add(field.occupancy.bits.data(), field.occupancy.bits.size());
  return checksum.text();
}

std::string headerOf(const Field& field) {
  const std::string description = describe(field);
  // The layout allows nothing but text in __metadata__.
  Json header;
  header["__metadata__"] = {{"format", kFormat},
                            {"version", std::to_string(kVersion)},
                            {"field", description},
                            {"checksum", checksumOf(description, field)}};
  std::size_t offset = 0;
  for (const Tensor& tensor : tensorsOf(field)) {
    header[tensor.name] = {{"dtype", tensor.type},
                           {"shape", tensor.shape},
                           {"data_offsets", {offset, offset + tensor.bytes}}};
    offset += tensor.bytes;
  }
  std::string text = header.dump();
  text.append((8 - text.size() % 8) % 8, ' ');  // tensors start at a multiple of 8
  return text;
}

/// An open model file, read front to back; every length is checked before memory is taken.
class ModelReader {
 public:
  explicit ModelReader(const std::string& path) : file_(path) {}

  FieldMetadata readMetadata() {
    const Json header = readHeader();
    const Field field = fieldFromDescription(checkMetadata(header));
    checkTensors(header, tensorsOf(field));
    return field.metadata;
  }

  Field read() {
    const Json header = readHeader();
    const std::string description = checkMetadata(header);
    Field field = fieldFromDescription(description);
    const std::array<Tensor, 4> tensors = tensorsOf(field);
    checkTensors(header, tensors);
    readTensor(tensors[0], &field.grid);
    readTensor(tensors[1], &field.density_weights);
    readTensor(tensors[2], &field.colour_weights);
    readTensor(tensors[3], &field.occupancy.bits);
    if (!isEqual(find(header["__metadata__"], "checksum"), checksumOf(description, field))) {
      throw std::runtime_error("damaged: the checksum does not fit the content");
    }
    field.validate();
    return field;
  }

 private:
  Json readHeader() {
    std::uint64_t length = 0;
    if (file_.size() < sizeof length) throw std::runtime_error("not a model: shorter than 8 bytes");
    readBytes(&length, sizeof length);
    if (length > kMaxHeaderBytes) throw std::runtime_error("not a model: no header at its start");
    if (length > bytesLeft()) throw std::runtime_error("cut short within its header");
    std::string text(length, '\0');
    readBytes(&text[0], text.size());
    Json header;
    try {
      header = parseJson(text);
    } catch (const std::runtime_error& error) {
      throw std::runtime_error("not a model: its header is no JSON: " + std::string(error.what()));
    }
    if (!header.is_object()) throw std::runtime_error("not a model: its header is no JSON object");
    return header;
  }

  /// @return the field's description.
  static std::string checkMetadata(const Json& header) {
    const Json* metadata = find(header, "__metadata__");
    const Json* format = metadata ? find(*metadata, "format") : nullptr;
    if (format == nullptr || *format != kFormat) {
      throw std::runtime_error("a file in the safetensors layout, but not a model of this package");
    }
    const Json* version = find(*metadata, "version");
    if (version == nullptr || *version != std::to_string(kVersion)) {
      throw std::runtime_error("its version is " + (version ? version->dump() : "missing") +
                               ", this program reads \"" + std::to_string(kVersion) + "\"");
    }
    const Json* description = find(*metadata, "field");
    if (description == nullptr || !description->is_string()) {
      throw std::runtime_error("damaged: the description is missing");
    }
    return *description;
  }

  /// Null if the value is no object, or has no such key.
  static const Json* find(const Json& value, const char* key) {
    const auto entry = value.find(key);
    return entry == value.end() ? nullptr : &*entry;
  }

  static bool isEqual(const Json* value, const Json& expected) {
    return value != nullptr && *value == expected;
  }

  void checkTensors(const Json& header, const std::array<Tensor, 4>& tensors) const {
    std::uint64_t total = 0;
    for (const Tensor& tensor : tensors) {
      const Json* entry = find(header, tensor.name);
      const bool fits = entry != nullptr && isEqual(find(*entry, "dtype"), tensor.type) &&
                        isEqual(find(*entry, "shape"), tensor.shape) &&
                        isEqual(find(*entry, "data_offsets"), Json({total, total + tensor.bytes}));
      if (!fits) {
        throw std::runtime_error(std::string("damaged: the tensor '") + tensor.name +
                                 "' is missing or of another shape than its configuration says");
      }
      total += tensor.bytes;
    }
    if (total != bytesLeft()) {
      throw std::runtime_error("cut short or too long: it should hold " + std::to_string(total) +
                               " bytes of tensors, and holds " + std::to_string(bytesLeft()));
    }
  }

  template <typename T>
  void readTensor(const Tensor& tensor, std::vector<T>* values) {
    values->resize(tensor.bytes / sizeof(T));
    readBytes(values->data(), tensor.bytes);
  }

  void readBytes(void* data, std::size_t bytes) {
    file_.read(offset_, data, bytes);
    offset_ += bytes;
  }

  std::uint64_t bytesLeft() const { return file_.size() - offset_; }

  InputFile file_;
  std::uint64_t offset_ = 0;  ///< of what is read next
};

}  // namespace

void saveModel(const Field& field, const std::string& path) {
  field.validate();
  const std::string header = headerOf(field);
  const std::uint64_t length = header.size();
  if (length > kMaxHeaderBytes) {
    throw std::runtime_error("cannot write '" + path + "': the object's name is too long");
  }
  AtomicFile file(path);
  file.write(&length, sizeof length);
  file.write(header.data(), header.size());
  file.write(field.grid.data(), field.grid.size() * sizeof(std::uint16_t));
  file.write(field.density_weights.data(), field.density_weights.size() * sizeof(float));
  file.write(field.colour_weights.data(), field.colour_weights.size() * sizeof(float));
  file.write(field.occupancy.bits.data(), field.occupancy.bits.size());
  file.commit();
}

void requireModelWritable(const FieldConfig& config, const std::string& path) {
  Field field;
  field.config = config;
  field.occupancy.resolution = config.occupancy_resolution;
  std::uint64_t bytes = sizeof(std::uint64_t) + kMaxHeaderBytes;
  for (const Tensor& tensor : tensorsOf(field)) bytes += tensor.bytes;
  requireWritable(path, bytes);
}

Field loadModel(const std::string& path) {
  try {
    return ModelReader(path).read();
  } catch (const std::exception& error) {
    throw std::runtime_error("cannot load the model '" + path + "': " + error.what());
  }
}

FieldMetadata readModelMetadata(const std::string& path) {
  try {
    return ModelReader(path).readMetadata();
  } catch (const std::exception& error) {
    throw std::runtime_error("cannot read the model '" + path + "': " + error.what());
  }
}

}  // namespace nerf_pose_refiner
