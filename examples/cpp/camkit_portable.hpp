// A portable camera (`camkit portable BUNDLE -o DIR`) in C++17: the mosaic of a capture in, linear
// Rec.709 out. One header on onnxruntime's C API, no other library. docs/portable.md is the contract.
//
//     camkit::Camera camera("duet-portable", {"S"});
//     camkit::Picture picture = camera.develop({samples, 1500, 1000, 400, {2.0f, 1.0f, 1.6f}});
//
// A camera holds its sessions, and what its filter knows of places, for all captures. Everything
// that goes wrong is a camkit::Error (but std::bad_alloc). Several threads may call develop() of one camera at once.
#pragma once

#include <onnxruntime_c_api.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <locale>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

namespace camkit {

struct Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Planes of float32, [channel][y][x].
struct Picture {
  int channels = 0, height = 0, width = 0;
  std::vector<float> data;
  Picture() = default;
  Picture(int c, int h, int w) : channels(c), height(h), width(w), data(std::size_t(c) * h * w) {}
  float* row(int c, int y) { return data.data() + (std::size_t(c) * height + y) * width; }
  const float* row(int c, int y) const { return const_cast<Picture*>(this)->row(c, y); }
};

struct Capture {
  const std::uint16_t* samples = nullptr;  // height rows of width samples in DN; not owned
  int width = 0, height = 0;
  double iso = 100;
  std::array<float, 3> white_balance{1, 1, 1};          // gains of R, G, B
  std::array<int, 2> origin_px{0, 0};                   // x, y of the first sample on the sensor
  std::optional<std::array<double, 2>> levels{};        // black and white; default: the sensor's
};

struct Options {
  std::string size = "M";                     // of the network
  int threads = 1;                            // of a graph
  std::size_t cache_bytes = 512u << 20;       // of places that are kept for later captures
};

// Gets the share that is done, after every block and tile; false ends develop() with an Error.
using Progress = std::function<bool(double)>;

namespace detail {

inline void check(bool holds, const std::string& message) {
  if (!holds) throw Error(message);
}

inline std::string read_file(const std::filesystem::path& path) {
  std::error_code none;
  std::ifstream file(path, std::ios::binary);
  check(file && !std::filesystem::is_directory(path, none), "cannot read " + path.string());
  std::ostringstream data;
  data << file.rdbuf();
  return data.str();
}

// ---- JSON: what portable.json and the head of a safetensors file need.

struct Json {
  enum class Kind { null, boolean, number, text, list, object } kind = Kind::null;
  double value = 0;
  std::string words;
  std::vector<std::string> keys;  // of an object; its values are the items
  std::vector<Json> items;

  const Json* find(std::string_view key) const {
    const auto at = std::find(keys.begin(), keys.end(), key);
    return at == keys.end() ? nullptr : &items[std::size_t(at - keys.begin())];
  }
  const Json& operator[](std::string_view key) const {
    const Json* found = find(key);
    check(found, "the manifest has no " + std::string(key));
    return *found;
  }
  const Json& of(Kind wanted, const char* name) const {
    check(kind == wanted, std::string("the manifest has no ") + name + " where one is needed");
    return *this;
  }
  double number() const { return of(Kind::number, "number").value; }
  int integer() const {
    check(std::abs(number()) < 1e9 && value == std::floor(value), "the manifest needs an integer");
    return int(value);
  }
  bool truth() const { return of(Kind::boolean, "true or false").value != 0; }
  const std::string& text() const { return of(Kind::text, "text").words; }
  const std::vector<Json>& list() const { return of(Kind::list, "list").items; }
  std::vector<std::string> texts() const {
    std::vector<std::string> all;
    for (const Json& item : list()) all.push_back(item.text());
    return all;
  }
  std::array<double, 2> pair() const {
    check(list().size() == 2, "the manifest needs two numbers");
    return {items[0].number(), items[1].number()};
  }
};

class JsonParser {
 public:
  explicit JsonParser(std::string_view text) : text_(text) {}
  Json document() {
    Json json = value(0);
    next();
    check(at_ == text_.size(), fault());
    return json;
  }

 private:
  std::string fault() const { return "damaged JSON at byte " + std::to_string(at_); }
  char next() {  // the next character that is no space; 0 at the end
    at_ = std::min(text_.find_first_not_of(" \t\r\n", at_), text_.size());
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool skip(std::string_view word) {
    const bool found = next() == word[0] && text_.substr(at_, word.size()) == word;
    at_ += found ? word.size() : 0;
    return found;
  }
  void need(std::string_view word) { check(skip(word), fault()); }
  Json value(int depth) {
    check(depth < 32, "JSON is nested too deeply");
    Json json;
    if (next() == '"') {
      json.kind = Json::Kind::text;
      json.words = string();
    } else if (skip("{") || skip("[")) {
      const bool object = text_[at_ - 1] == '{';
      const char* close = object ? "}" : "]";
      json.kind = object ? Json::Kind::object : Json::Kind::list;
      for (bool more = !skip(close); more; more = skip(",") || (need(close), false)) {
        if (object) json.keys.push_back(string()), need(":");
        json.items.push_back(value(depth + 1));
      }
    } else if (skip("true") || skip("false")) {
      json.kind = Json::Kind::boolean;
      json.value = text_[at_ - 2] == 'u';
    } else if (!skip("null")) {
      json.kind = Json::Kind::number;
      json.value = number();
    }
    return json;
  }
  double number() {  // in the notation of C, whatever the locale of the program
    const std::size_t last = std::min(text_.find_first_not_of("+-.0123456789eE", at_), text_.size());
    std::istringstream digits{std::string(text_.substr(at_, last - at_))};
    digits.imbue(std::locale::classic());
    double number = 0;
    check(bool(digits >> number) && digits.peek() == std::istringstream::traits_type::eof(), fault());
    at_ = last;
    return number;
  }
  std::string string() {
    need("\"");
    std::string out;
    for (;; ++at_) {
      check(at_ < text_.size(), fault());
      if (text_[at_] == '"') break;
      if (text_[at_] != '\\') {
        out += text_[at_];
        continue;
      }
      check(++at_ < text_.size(), fault());
      static constexpr char names[] = "\"\\/bfnrt", values[] = "\"\\/\b\f\n\r\t";
      if (text_[at_] == 'u') {
        utf8(out);
      } else {
        const char* known = std::strchr(names, text_[at_]);
        check(known && *known, fault());
        out += values[known - names];
      }
    }
    ++at_;
    return out;
  }
  unsigned hex() {  // the four digits after the u at at_
    check(at_ + 4 < text_.size(), fault());
    unsigned code = 0;
    for (int i = 0; i < 4; ++i) {
      const char c = text_[++at_];
      const int digit = c >= '0' && c <= '9' ? c - '0' : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10 : -1;
      check(digit >= 0, fault());
      code = code * 16 + unsigned(digit);
    }
    return code;
  }
  void utf8(std::string& out) {
    unsigned code = hex();
    if (code >= 0xD800 && code < 0xDC00 && text_.substr(at_ + 1, 2) == "\\u") {
      at_ += 2;
      code = 0x10000 + ((code - 0xD800) << 10) + (hex() & 0x3FF);
    }
    const int more = code < 0x80 ? 0 : code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
    constexpr unsigned heads[] = {0, 0xC0, 0xE0, 0xF0};
    out += char(heads[more] | (code >> (6 * more)));
    for (int i = more - 1; i >= 0; --i) out += char(0x80 | ((code >> (6 * i)) & 0x3F));
  }
  std::string_view text_;
  std::size_t at_ = 0;
};

// ---- onnxruntime: handles that release themselves, errors as exceptions.

template <class T>
using Handle = std::unique_ptr<T, void(ORT_API_CALL*)(T*)>;
using Value = std::shared_ptr<OrtValue>;  // a place's values are shared with the cache
using Values = std::map<std::string, Value, std::less<>>;
using Shape = std::vector<std::int64_t>;

// Later libraries keep the API of earlier ones: headers and library may be of different versions.
constexpr std::uint32_t api_version = 17;
static_assert(api_version <= ORT_API_VERSION, "the headers of onnxruntime are too old");

class Engine {
 public:
  explicit Engine(int threads)
      : api(OrtGetApiBase()->GetApi(api_version)),
        env_(nullptr, nullptr), options_(nullptr, nullptr), memory_(nullptr, nullptr) {
    check(api, std::string("onnxruntime ") + OrtGetApiBase()->GetVersionString() + " is too old; 1." +
                   std::to_string(api_version) + " or newer is needed");
    check(threads >= 1, "threads must be 1 or more");
    OrtEnv* env = nullptr;
    ok(api->CreateEnv(ORT_LOGGING_LEVEL_WARNING, "camkit", &env));
    env_ = {env, api->ReleaseEnv};
    OrtSessionOptions* options = nullptr;
    ok(api->CreateSessionOptions(&options));
    options_ = {options, api->ReleaseSessionOptions};
    ok(api->SetIntraOpNumThreads(options, threads));
    OrtMemoryInfo* memory = nullptr;
    ok(api->CreateCpuMemoryInfo(OrtArenaAllocator, OrtMemTypeDefault, &memory));
    memory_ = {memory, api->ReleaseMemoryInfo};
  }
  void ok(OrtStatus* status) const {
    if (!status) return;
    const Handle<OrtStatus> held(status, api->ReleaseStatus);
    throw Error(std::string("onnxruntime: ") + api->GetErrorMessage(status));
  }
  Handle<OrtSession> session(const std::filesystem::path& path) const {
    OrtSession* made = nullptr;
    ok(api->CreateSession(env_.get(), path.c_str(), options_.get(), &made));
    return {made, api->ReleaseSession};
  }
  Value hold(OrtValue* value) const { return {value, api->ReleaseValue}; }

  // A view: the data must outlive it.
  template <class T>
  Value tensor(const T* data, std::size_t count, const Shape& shape) const {
    constexpr auto type = std::is_same_v<T, float>    ? ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT
                          : std::is_same_v<T, double> ? ONNX_TENSOR_ELEMENT_DATA_TYPE_DOUBLE
                                                      : ONNX_TENSOR_ELEMENT_DATA_TYPE_INT64;
    static_assert(std::is_same_v<T, float> || std::is_same_v<T, double> || std::is_same_v<T, std::int64_t>);
    OrtValue* made = nullptr;  // onnxruntime writes to no input
    ok(api->CreateTensorWithDataAsOrtValue(memory_.get(), const_cast<T*>(data), count * sizeof(T),
                                           shape.data(), shape.size(), type, &made));
    return hold(made);
  }
  template <class Container>
  Value tensor(const Container& data, const Shape& shape) const {
    return tensor(data.data(), data.size(), shape);
  }
  template <class Container>
  Value tensor(const Container& data) const {
    return tensor(data, {std::int64_t(data.size())});
  }
  // The float32 values of a tensor, and their number.
  std::pair<const float*, std::size_t> floats(const Value& value) const {
    OrtTensorTypeAndShapeInfo* raw = nullptr;
    ok(api->GetTensorTypeAndShape(value.get(), &raw));
    const Handle<OrtTensorTypeAndShapeInfo> info(raw, api->ReleaseTensorTypeAndShapeInfo);
    ONNXTensorElementDataType type{};
    std::size_t count = 0;
    ok(api->GetTensorElementType(raw, &type));
    ok(api->GetTensorShapeElementCount(raw, &count));
    check(type == ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, "a graph gave another type than float32");
    void* data = nullptr;
    ok(api->GetTensorMutableData(value.get(), &data));
    return {static_cast<const float*>(data), count};
  }
  const OrtApi* const api;

 private:
  Handle<OrtEnv> env_;
  Handle<OrtSessionOptions> options_;
  Handle<OrtMemoryInfo> memory_;
};

struct Graph {
  Handle<OrtSession> session;
  std::vector<std::string> inputs, outputs;
  Values tables;
};

struct Table {
  Shape shape;
  std::vector<float> data;
};

inline std::map<std::string, Table> read_safetensors(const std::filesystem::path& path) {
  const std::string data = read_file(path);
  std::uint64_t head = 0;
  for (std::size_t i = 0; i < 8 && i < data.size(); ++i) head |= std::uint64_t(std::uint8_t(data[i])) << (8 * i);
  check(data.size() >= 8 && head <= data.size() - 8, path.string() + " is cut short");
  const Json json = JsonParser(std::string_view(data).substr(8, head)).document();
  const std::string_view body = std::string_view(data).substr(8 + head);
  std::map<std::string, Table> tables;
  for (std::size_t i = 0; i < json.keys.size(); ++i) {
    if (json.keys[i] == "__metadata__") continue;
    Table& table = tables[json.keys[i]];
    double count = 1;
    for (const Json& side : json.items[i]["shape"].list()) {
      check(side.integer() >= 0, path.string() + " is damaged");
      table.shape.push_back(side.integer());
      count *= side.integer();
    }
    check(json.items[i]["dtype"].text() == "F32", "table " + json.keys[i] + " is not float32");
    const auto [first, last] = json.items[i]["data_offsets"].pair();
    check(first >= 0 && last <= double(body.size()) && last - first == 4 * count, path.string() + " is damaged");
    table.data.resize(std::size_t(count));
    std::memcpy(table.data.data(), body.data() + std::size_t(first), table.data.size() * sizeof(float));
  }
  return tables;
}

// ---- Loops.

// A block along one axis: its first sample, its window (0 outside the picture), its middle.
struct Span {
  int first = 0;
  std::vector<float> window{};
  double middle = 0;
};

inline std::vector<Span> spans(int size, int block, int overlap, int border) {
  const int step = block - overlap;
  const int count = std::max(1, (size + 2 * border - overlap + step - 1) / step);
  const int before = count * step + overlap - size;
  const int start = -(before >= 0 ? before / 2 : (before - 1) / 2);
  const auto rise = [overlap](int i) {
    const double t = (i + 0.5 - overlap / 4.0) / (overlap / 2.0);
    const double s = std::sin(1.5707963267948966 * std::clamp(t, 0.0, 1.0));
    return s * s;
  };
  std::vector<Span> all;
  for (int i = 0; i < count; ++i) {
    Span span{start + i * step, std::vector<float>(std::size_t(block)), 0};
    int low = block, high = 0;
    for (int k = 0; k < block; ++k) {
      double window = 1;
      if (i > 0 && k < overlap) window *= rise(k);
      if (i < count - 1 && k >= block - overlap) window *= rise(block - 1 - k);
      const bool inside = span.first + k >= 0 && span.first + k < size;
      const float value = inside ? float(window) : 0.0f;
      span.window[std::size_t(k)] = value;
      if (value != 0) low = std::min(low, k), high = k;
    }
    span.middle = span.first + (low + high) / 2.0;
    all.push_back(std::move(span));
  }
  return all;
}

// A tile along one axis: its first pixel, and the first and the last but one that is kept.
struct Tile {
  int first, from, to;
};

// Tiles of one side along an axis, and that side; size is a multiple of the stride.
inline std::pair<std::vector<Tile>, int> tiles(int size, int most, int halo, int stride) {
  check(stride > 0 && halo >= 0 && most > 2 * halo, "tiles are no larger than their halos");
  const int step = most - 2 * halo, count = std::max(1, (size - 2 * halo + step - 1) / step);
  const std::int64_t cells = std::int64_t(count) * stride, sum = size + (count - 1) * std::int64_t(2) * halo;
  const int side = int((sum + cells - 1) / cells * stride);
  std::vector<Tile> all{{0, 0, size}};
  for (int i = 1; i < count; ++i) {
    const int first = std::min(i * (side - 2 * halo), size - side);
    all.back().to = first + halo;
    all.push_back({first, first + halo, size});
  }
  return {all, side};
}

// The samples of a block with its margin along one axis, mirrored about the outermost ones.
inline std::vector<int> fold(int first, int block, int margin, int size, bool flip) {
  const int period = std::max(2 * (size - 1), 1);
  std::vector<int> at;
  for (int i = first - margin; i < first + block + margin; ++i) {
    const int k = ((i % period) + period) % period;
    at.push_back(size > 1 ? std::min(k, period - k) : 0);
  }
  if (flip) std::reverse(at.begin(), at.end());
  return at;
}

}  // namespace detail

class Camera {
 public:
  explicit Camera(const std::filesystem::path& folder, Options options = {})
      : options_(std::move(options)), engine_(options_.threads) {
    using namespace detail;
    about_ = JsonParser(read_file(folder / "portable.json")).document();
    check(about_["portable_version"].integer() == 1, "portable.json is of another version than 1");
    const Json& networks = about_["networks"];
    std::string known;
    for (const std::string& size : networks.keys) known += " " + size;
    network_ = networks.find(options_.size);
    check(network_, "the camera has no network of size " + options_.size + "; it has" + known);
    const Json& sensor = about_["sensor"];
    pitch_mm_ = sensor["pitch_mm"].number();
    red_ = int(std::min(sensor["cfa"].text().find('R'), std::size_t(4)));
    check(red_ < 4, "the sensor has no red samples");
    tables_ = read_safetensors(folder / about_["tables"].text());
    const Json& graphs = about_["graphs"];
    for (std::size_t i = 0; i < graphs.keys.size(); ++i) {
      const std::string& name = graphs.keys[i];
      const auto runs_it = [&name](const Json& one) { return one["graph"].text() == name; };
      const bool other = std::any_of(networks.items.begin(), networks.items.end(), runs_it);
      if (!other || runs_it(*network_)) load(folder, name, graphs.items[i]);
    }
  }

  // Returns linear Rec.709, (3, height, width), not clipped; without the warp the camera's colours.
  Picture develop(const Capture& capture, bool warp = true, const Progress& progress = {}) const {
    using detail::check;
    check(capture.samples && capture.width > 0 && capture.height > 0, "the capture is empty");
    check(capture.width < (1 << 20) && capture.height < (1 << 20), "the capture is too large");
    check(std::isfinite(capture.iso) && capture.iso > 0, "iso must be above 0");
    for (const float gain : capture.white_balance)
      check(std::isfinite(gain) && gain > 0, "gains of the white balance must be above 0");
    const Known known = known_of(capture);
    const auto tell = [&progress](double first, double last) {
      return [&progress, first, last](double share) {
        check(!progress || progress(first + (last - first) * share), "stopped by the caller");
      };
    };
    const Picture planes = restore(capture, known, tell(0, 0.5));
    Picture even = clean(planes, kept(capture, known), known, tell(0.5, 0.9));
    return warp ? straighten(even, known, tell(0.9, 1)) : even;
  }

 private:
  using Values = detail::Values;
  using Place = std::array<double, 2>;  // x, y from the axis in mm
  struct Block {
    const detail::Span *y, *x;
    bool down, across;  // mirrored
  };
  struct Known {  // of a capture; the values are views of the numbers
    Place axis;
    float clip;
    std::array<float, 3> levels, gains, shot, read_variance;
  };

  void load(const std::filesystem::path& folder, const std::string& name, const detail::Json& json) {
    detail::Graph graph{engine_.session(folder / json["file"].text()), json["inputs"].texts(),
                        json["outputs"].texts(), {}};
    for (const std::string& table : json["tables"].texts()) {
      const auto found = tables_.find(table);
      detail::check(found != tables_.end(), "the tables lack " + table + ", which " + name + " needs");
      graph.tables[table] = engine_.tensor(found->second.data, found->second.shape);
    }
    graphs_.emplace(name, std::move(graph));
  }

  Values run(const std::string& name, const Values& values) const {
    const auto graph = graphs_.find(name);
    detail::check(graph != graphs_.end(), "the camera has no graph " + name);
    const auto& [session, inputs, outputs, tables] = graph->second;
    std::vector<const char*> in, out;
    std::vector<const OrtValue*> given;
    std::vector<OrtValue*> made(outputs.size(), nullptr);
    for (const std::string& input : inputs) {
      const auto value = values.find(input);
      detail::check(value != values.end(), "graph " + name + " needs " + input + ", which is unknown here");
      in.push_back(input.c_str()), given.push_back(value->second.get());
    }
    for (const auto& [table, value] : tables) in.push_back(table.c_str()), given.push_back(value.get());
    for (const std::string& output : outputs) out.push_back(output.c_str());
    engine_.ok(engine_.api->Run(session.get(), nullptr, in.data(), given.data(), given.size(), out.data(),
                                out.size(), made.data()));
    Values results;
    for (std::size_t i = 0; i < made.size(); ++i) results[outputs[i]] = engine_.hold(made[i]);
    return results;
  }

  Values values_of(const Known& known) const {
    return {{"levels", engine_.tensor(known.levels)},
            {"gains", engine_.tensor(known.gains)},
            {"shot", engine_.tensor(known.shot)},
            {"read_variance", engine_.tensor(known.read_variance)}};
  }

  Known known_of(const Capture& capture) const {
    const detail::Json& sensor = about_["sensor"];
    const double of_black = sensor["black_level"].number(), of_white = sensor["white_level"].number();
    const auto [black, white] = capture.levels.value_or(Place{of_black, of_white});
    detail::check(black < white, "the white level must be above the black level");
    const double clip = std::ceil(black + sensor["clip_share"].number() * (white - black));
    const Place axis = sensor["axis_px"].pair();
    Known known{{axis[0] - capture.origin_px[0], axis[1] - capture.origin_px[1]},
                float(clip), {float(black), float(white), float(clip)}, capture.white_balance, {}, {}};
    // Noise: ln gain and read noise lie on lines of ln ISO between the entries.
    const std::vector<detail::Json>& table = sensor["noise"].list();
    detail::check(!table.empty(), "the sensor has no noise");
    const auto log_iso = [&table](std::size_t i) { return std::log(table[i]["iso"].number()); };
    const double last = log_iso(table.size() - 1), wanted = std::log(capture.iso);
    const double inside = std::min(std::max(wanted, log_iso(0)), last);
    const auto at = [&](auto&& of) {
      std::size_t i = 0;
      while (i + 1 < table.size() && log_iso(i + 1) <= inside) ++i;
      if (i + 1 == table.size() || log_iso(i) == inside) return of(table[i]);
      const double slope = (of(table[i + 1]) - of(table[i])) / (log_iso(i + 1) - log_iso(i));
      return slope * (inside - log_iso(i)) + of(table[i]);
    };
    using detail::Json;
    const double log_gain = at([](const Json& one) { return std::log(one["gain_e_per_dn"].number()); });
    const double gain = std::exp(log_gain - std::max(wanted - last, 0.0));
    const double shot = 1 / (gain * (of_white - of_black));
    const double read = at([](const Json& one) { return one["read_noise_e"].number(); }) * shot;
    known.shot.fill(float(shot));
    known.read_variance.fill(float(read * read));
    return known;
  }

  // Returns what the filter of a place needs, from the cache where it is there.
  Values place(const std::string& graph, const Place& place_mm) const {
    const auto key = std::make_pair(graph, place_mm);
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (const auto found = places_.find(key); found != places_.end()) return found->second;
    }
    const std::array<float, 2> given{float(place_mm[0]), float(place_mm[1])};
    Values values = run(graph, {{"place_mm", engine_.tensor(given)}});
    std::size_t bytes = 0;
    for (const auto& [name, value] : values) bytes += engine_.floats(value).second * sizeof(float);
    const std::lock_guard<std::mutex> lock(mutex_);
    if (cached_bytes_ + bytes <= options_.cache_bytes && places_.emplace(key, values).second) cached_bytes_ += bytes;
    return values;
  }

  // Returns demosaicked and restored planes, (6, h, w): place after place, mirrored ones are one.
  template <class Tell>
  Picture restore(const Capture& capture, const Known& known, const Tell& tell) const {
    const detail::Json& bank = about_["bank"];
    const int block = bank["block_px"].integer(), margin = bank["margin_px"].integer();
    const int overlap = bank["overlap_px"].integer(), border = bank["border_px"].integer();
    const bool mirrors = bank["mirrors"].truth(), lights = bank["lights"].truth();
    detail::check(block > overlap && overlap > 0 && margin >= 0 && block < (1 << 12) && margin < block, "the manifest's blocks are damaged");
    const detail::Json& within = bank["mosaic_within_mm"];
    const auto rows = detail::spans(capture.height, block, overlap, border);
    const auto columns = detail::spans(capture.width, block, overlap, border);
    std::vector<std::pair<Place, std::vector<Block>>> places;
    std::map<Place, std::size_t> index;
    const auto rounded = [](double mm) { return std::nearbyint(mm * 1e9) / 1e9; };
    for (const detail::Span& y : rows)
      for (const detail::Span& x : columns) {
        const double x_mm = (x.middle - known.axis[0]) * pitch_mm_, y_mm = (y.middle - known.axis[1]) * pitch_mm_;
        const bool across = mirrors && x_mm < 0, down = mirrors && y_mm < 0;
        const Place at{rounded(across ? -x_mm : x_mm), rounded(down ? -y_mm : y_mm)};
        const auto [found, is_new] = index.emplace(at, places.size());
        if (is_new) places.emplace_back(at, std::vector<Block>{});
        places[found->second].second.push_back({&y, &x, down, across});
      }
    Picture total(6, capture.height, capture.width);
    const Values fixed = values_of(known);
    double done = 0;
    for (const auto& [at, blocks] : places) {
      const bool near = within.kind == detail::Json::Kind::number && std::hypot(at[0], at[1]) <= within.number();
      const std::string kind = near ? "_mosaic" : "";
      Values values = place("place" + kind, at);
      values.insert(fixed.begin(), fixed.end());
      for (const Block& one : blocks) {
        add_block(capture, known, one, {block, margin}, values, "block" + kind, lights, total);
        tell(++done / double(rows.size() * columns.size()));
      }
    }
    return total;
  }

  void add_block(const Capture& capture, const Known& known, const Block& one, std::array<int, 2> sides,
                 Values& values, const std::string& graph, bool lights, Picture& total) const {
    const auto [block, margin] = sides;
    const int side = block + 2 * margin;
    const std::vector<int> ys = detail::fold(one.y->first, block, margin, capture.height, one.down);
    const std::vector<int> xs = detail::fold(one.x->first, block, margin, capture.width, one.across);
    std::vector<float> mosaic(std::size_t(side) * std::size_t(side));
    float most = 0;
    for (int i = 0; i < side; ++i) {
      const std::uint16_t* samples = capture.samples + std::size_t(ys[std::size_t(i)]) * std::size_t(capture.width);
      float* row = mosaic.data() + std::size_t(i) * std::size_t(side);
      for (int k = 0; k < side; ++k) row[k] = samples[xs[std::size_t(k)]];
      if (i >= margin && i < side - margin) most = std::max(most, *std::max_element(row + margin, row + side - margin));
    }
    const auto turned = [](const std::vector<float>& window, bool flip) {
      return flip ? std::vector<float>(window.rbegin(), window.rend()) : window;
    };
    const std::vector<float> wy = turned(one.y->window, one.down), wx = turned(one.x->window, one.across);
    const int phase_y = (red_ / 2 - one.y->first - one.down) & 1, phase_x = (red_ % 2 - one.x->first - one.across) & 1;
    const std::array<std::int64_t, 1> phase{2 * phase_y + phase_x};
    values["mosaic"] = engine_.tensor(mosaic, {side, side});
    values["window_y"] = engine_.tensor(wy);
    values["window_x"] = engine_.tensor(wx);
    values["phase"] = engine_.tensor(phase);
    const bool lit = lights && most >= known.clip;
    const Values made = run(graph + (lit ? "_lights" : ""), values);
    const float* out = floats(made, "out", 6 * std::size_t(block) * std::size_t(block));
    const int left = std::max(one.x->first, 0), right = std::min(one.x->first + block, capture.width);
    const int top = std::max(one.y->first, 0), bottom = std::min(one.y->first + block, capture.height);
    for (int c = 0; c < 6; ++c)
      for (int y = top; y < bottom; ++y) {
        const int i = one.down ? block - 1 - (y - one.y->first) : y - one.y->first;
        const float* row = out + (std::size_t(c) * std::size_t(block) + std::size_t(i)) * std::size_t(block);
        float* sum = total.row(c, y);
        if (one.across)
          for (int x = left; x < right; ++x) sum[x] += row[block - 1 - (x - one.x->first)];
        else
          for (int x = left; x < right; ++x) sum[x] += row[x - one.x->first];
      }
  }

  const float* floats(const Values& made, const char* name, std::size_t count) const {
    const auto found = made.find(name);
    detail::check(found != made.end(), std::string("a graph has no output ") + name);
    const auto [data, got] = engine_.floats(found->second);
    detail::check(got == count, "a graph gave " + std::to_string(got) + " values, not " + std::to_string(count));
    return data;
  }

  // Returns how much of what the network adds is kept beside clipped samples, (1, h, w).
  Picture kept(const Capture& capture, const Known& known) const {
    Picture mask(1, capture.height, capture.width);
    std::transform(capture.samples, capture.samples + mask.data.size(), mask.data.begin(),
                   [&known](std::uint16_t sample) { return float(sample) >= known.clip ? 1.0f : 0.0f; });
    const Values made = run("kept", {{"clipped", engine_.tensor(mask.data, {1, 1, mask.height, mask.width})}});
    const float* out = floats(made, "out", mask.data.size());
    std::copy_n(out, mask.data.size(), mask.data.begin());
    return mask;
  }

  // Returns a box of a picture; beyond its last row and column these repeat.
  static std::vector<float> cut(const Picture& picture, int y, int x, int height, int width) {
    std::vector<float> box(std::size_t(picture.channels) * std::size_t(height) * std::size_t(width));
    float* to = box.data();
    const int inside = std::min(width, picture.width - x);
    for (int c = 0; c < picture.channels; ++c)
      for (int i = 0; i < height; ++i, to += width) {
        const float* from = picture.row(c, std::min(y + i, picture.height - 1)) + x;
        std::fill(std::copy_n(from, inside, to), to + width, from[inside - 1]);
      }
    return box;
  }

  // Returns light of the camera's colours, clean and even, (3, h, w).
  template <class Tell>
  Picture clean(const Picture& planes, const Picture& kept, const Known& known, const Tell& tell) const {
    const int halo = (*network_)["halo_px"].integer(), stride = (*network_)["stride_px"].integer();
    const int most = about_["tile_px"].integer();
    detail::check(stride > 0 && stride < (1 << 12), "the manifest's tiles are damaged");
    const auto whole = [stride](int size) { return (size + stride - 1) / stride * stride; };
    const auto [rows, h] = detail::tiles(whole(planes.height), most, halo, stride);
    const auto [columns, w] = detail::tiles(whole(planes.width), most, halo, stride);
    Picture even(3, planes.height, planes.width);
    Values values = values_of(known);
    double done = 0;
    for (const detail::Tile& y : rows)
      for (const detail::Tile& x : columns) {
        const std::vector<float> box = cut(planes, y.first, x.first, h, w), share = cut(kept, y.first, x.first, h, w);
        const std::array<float, 2> origin{float((x.first - known.axis[0]) * pitch_mm_),
                                          float((y.first - known.axis[1]) * pitch_mm_)};
        values["planes"] = engine_.tensor(box, {1, 6, h, w});
        values["kept"] = engine_.tensor(share, {1, 1, h, w});
        values["origin_mm"] = engine_.tensor(origin);
        const Values made = run((*network_)["graph"].text(), values);
        const float* out = floats(made, "out", 3 * std::size_t(h) * std::size_t(w));
        const int right = std::min(x.to, even.width);
        for (int c = 0; c < 3; ++c)
          for (int i = y.from; i < std::min(y.to, even.height); ++i) {
            const float* row = out + (std::size_t(c) * std::size_t(h) + std::size_t(i - y.first)) * std::size_t(w);
            std::copy(row + x.from - x.first, row + right - x.first, even.row(c, i) + x.from);
          }
        tell(++done / double(rows.size() * columns.size()));
      }
    return even;
  }

  // Returns linear Rec.709 without distortion, (3, h, w).
  template <class Tell>
  Picture straighten(const Picture& even, const Known& known, const Tell& tell) const {
    const int side = about_["warp_px"].integer();
    const float white = float(about_["warp_white"].number()), floor = float(about_["warp_floor"].number());
    detail::check(side > 0 && side < (1 << 12), "the manifest's tiles are damaged");
    const std::array<int, 2> size{even.width, even.height};
    const Place middle{(even.width - 1) / 2.0, (even.height - 1) / 2.0};
    Picture straight(3, even.height, even.width);
    for (int y = 0; y < even.height; y += side)
      for (int x = 0; x < even.width; x += side) {
        const std::array<int, 2> at{x, y};
        const Place target{double(x), double(y)};
        Values values = run("places", {{"target_px", engine_.tensor(target)},
                                       {"axis_px", engine_.tensor(known.axis)},
                                       {"middle_px", engine_.tensor(middle)}});
        const float* least = floats(values, "least", 2);
        const float* most = floats(values, "most", 2);
        std::array<int, 2> first{}, last{};
        std::array<float, 2> first_px{};
        for (std::size_t i = 0; i < 2; ++i) {
          detail::check(std::abs(least[i]) < 1e8f && std::abs(most[i]) < 1e8f, "the places of a tile are no numbers");
          first[i] = std::clamp(int(std::floor(least[i])) - 1 + at[i], 0, size[i] - 1);
          last[i] = std::clamp(int(std::ceil(most[i])) + 3 + at[i], first[i] + 1, size[i]);
          first_px[i] = float(first[i] - at[i]);
        }
        const int height = last[1] - first[1], width = last[0] - first[0];
        const std::vector<float> box = cut(even, first[1], first[0], height, width);
        values["planes"] = engine_.tensor(box, {1, 3, height, width});
        values["first_px"] = engine_.tensor(first_px);
        Values made;  // rims of lamps cost time: only where light is above white, or falls below black
        const bool plain = *std::max_element(box.begin(), box.end()) <= white;
        if (plain) made = run("warp", values);
        if (!plain || floats(made, "least", 1)[0] < floor) made = run("warp_limited", values);
        const float* out = floats(made, "out", 3 * std::size_t(side) * std::size_t(side));
        for (int c = 0; c < 3; ++c)
          for (int i = 0; i < std::min(side, even.height - y); ++i)
            std::copy_n(out + (std::size_t(c) * std::size_t(side) + std::size_t(i)) * std::size_t(side),
                        std::min(side, even.width - x), straight.row(c, y + i) + x);
        tell(double(y) / even.height);
      }
    tell(1.0);
    return straight;
  }

  Options options_;
  detail::Engine engine_;
  detail::Json about_;
  const detail::Json* network_ = nullptr;  // of about_
  double pitch_mm_ = 0;
  int red_ = 0;  // 2 row + column of red in the cell at the sensor's first sample
  std::map<std::string, detail::Table> tables_;
  std::map<std::string, detail::Graph> graphs_;
  mutable std::mutex mutex_;  // of what is below: sessions may run in several threads
  mutable std::map<std::pair<std::string, Place>, Values> places_;
  mutable std::size_t cached_bytes_ = 0;
};

}  // namespace camkit
