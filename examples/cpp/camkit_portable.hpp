// A portable camera (`camkit portable BUNDLE -o DIR`) in C++17: the mosaic of a capture in, linear
// Rec.709 out. One header on onnxruntime's C API, no other library. docs/guides/portable.md is the contract.
//
//     camkit::Camera camera("duet-portable", {"S"});
//     camkit::Picture picture = camera.develop({samples, 1500, 1000, 400, {2.0f, 1.0f, 1.6f}});
//
// A camera holds its sessions, and what its filter knows of places, for all captures. Everything
// that goes wrong is a camkit::Error (but std::bad_alloc). Several threads may call develop() of one
// camera at once. Set ORT_DISABLE_TELEMETRY=1 before the first camera, or onnxruntime keeps records.
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

template <class T>
constexpr ONNXTensorElementDataType type_of = ONNX_TENSOR_ELEMENT_DATA_TYPE_UNDEFINED;
template <>
inline constexpr ONNXTensorElementDataType type_of<float> = ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT;
template <>
inline constexpr ONNXTensorElementDataType type_of<double> = ONNX_TENSOR_ELEMENT_DATA_TYPE_DOUBLE;
template <>
inline constexpr ONNXTensorElementDataType type_of<std::int64_t> = ONNX_TENSOR_ELEMENT_DATA_TYPE_INT64;

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
    ok(api->DisableTelemetryEvents(env));
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
    OrtValue* made = nullptr;  // onnxruntime writes to no input
    ok(api->CreateTensorWithDataAsOrtValue(memory_.get(), const_cast<T*>(data), count * sizeof(T),
                                           shape.data(), shape.size(), type_of<T>, &made));
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
  // The values of a tensor, and their number.
  template <class T>
  std::pair<const T*, std::size_t> data(const Value& value) const {
    OrtTensorTypeAndShapeInfo* raw = nullptr;
    ok(api->GetTensorTypeAndShape(value.get(), &raw));
    const Handle<OrtTensorTypeAndShapeInfo> info(raw, api->ReleaseTensorTypeAndShapeInfo);
    ONNXTensorElementDataType type{};
    std::size_t count = 0;
    ok(api->GetTensorElementType(raw, &type));
    ok(api->GetTensorShapeElementCount(raw, &count));
    check(type == type_of<T>, "a graph gave values of another type");
    void* values = nullptr;
    ok(api->GetTensorMutableData(value.get(), &values));
    return {static_cast<const T*>(values), count};
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

}  // namespace detail

class Camera {
 public:
  explicit Camera(const std::filesystem::path& folder, Options options = {})
      : options_(std::move(options)), engine_(options_.threads) {
    using namespace detail;
    about_ = JsonParser(read_file(folder / "portable.json")).document();
    const int version = about_["portable_version"].integer();
    check(version == 1 || version == 2, "portable.json is of another version than 1 and 2");
    const Json* kind = about_.find("kind");
    check(!kind || kind->text() == "bayer", "the camera is no Bayer camera");
    const Json& networks = about_["networks"];
    std::string known;
    for (const std::string& size : networks.keys) known += " " + size;
    network_ = networks.find(options_.size);
    check(network_, "the camera has no network of size " + options_.size + "; it has" + known);
    tables_ = read_safetensors(folder / about_["tables"].text());
    std::vector<std::string> names = about_["common"].texts();
    names.push_back((*network_)["graph"].text());
    for (const std::string& name : names) load(folder, name, about_["graphs"][name]);
  }

  // Returns linear Rec.709, (3, height, width), not clipped; without the warp the camera's colours.
  Picture develop(const Capture& capture, bool warp = true, const Progress& progress = {}) const {
    using detail::check;
    check(capture.samples && capture.width > 0 && capture.height > 0, "the capture is empty");
    check(capture.width < (1 << 20) && capture.height < (1 << 20), "the capture is too large");
    check(std::isfinite(capture.iso) && capture.iso > 0, "iso must be above 0");
    for (const float gain : capture.white_balance)
      check(std::isfinite(gain) && gain > 0, "gains of the white balance must be above 0");
    const detail::Json& sensor = about_["sensor"];
    const auto [black, white] =
        capture.levels.value_or(Point{sensor["black_level"].number(), sensor["white_level"].number()});
    check(black < white, "the white level must be above the black level");
    const Point axis = sensor["axis_px"].pair();
    const double clip = std::ceil(black + sensor["clip_share"].number() * (white - black));
    const std::array<double, 1> iso{capture.iso};
    const std::array<float, 3> levels{float(black), float(white), float(clip)};
    Known known{{axis[0] - capture.origin_px[0], axis[1] - capture.origin_px[1]}, float(clip), {}};
    known.values = run("noise", {{"iso", engine_.tensor(iso)}});
    known.values["levels"] = engine_.tensor(levels);
    known.values["gains"] = engine_.tensor(capture.white_balance);
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
  using Point = std::array<double, 2>;  // x, y
  using Place = std::array<float, 2>;   // x, y in mm from the axis, the far sides mirrored
  struct Known {                        // what all graphs of a capture are given, as views
    Point axis;
    float clip;
    Values values;
  };
  struct Spans {  // the blocks along one axis
    std::vector<std::int64_t> first_px, turn, phase, index;
    std::vector<float> place_mm, window;
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

  template <class T>
  std::vector<T> copy(const Values& made, const std::string& name) const {
    const auto found = made.find(name);
    detail::check(found != made.end(), "a graph has no output " + name);
    const auto [data, count] = engine_.data<T>(found->second);
    return {data, data + count};
  }

  const float* floats(const Values& made, const std::string& name, std::size_t count) const {
    const auto found = made.find(name);
    detail::check(found != made.end(), "a graph has no output " + name);
    const auto [data, got] = engine_.data<float>(found->second);
    detail::check(got == count, "a graph gave " + std::to_string(got) + " values, not " + std::to_string(count));
    return data;
  }

  Spans spans(int size, double axis, int red, int block, int margin) const {
    const std::array<std::int64_t, 1> size_px{size}, red_px{red};
    const std::array<double, 1> axis_px{axis};
    const Values made = run("spans", {{"size_px", engine_.tensor(size_px)},
                                      {"axis_px", engine_.tensor(axis_px)},
                                      {"red", engine_.tensor(red_px)}});
    Spans all{copy<std::int64_t>(made, "first_px"), copy<std::int64_t>(made, "turn"),
              copy<std::int64_t>(made, "phase"),    copy<std::int64_t>(made, "index"),
              copy<float>(made, "place_mm"),        copy<float>(made, "window")};
    const std::size_t n = all.first_px.size(), side = std::size_t(block);
    const bool whole = all.turn.size() == n && all.phase.size() == n && all.place_mm.size() == n &&
                       all.window.size() == n * side && all.index.size() == n * (side + 2 * std::size_t(margin));
    const auto outside = [size](std::int64_t i) { return i < 0 || i >= size; };
    detail::check(whole && std::none_of(all.index.begin(), all.index.end(), outside), "the graph spans is damaged");
    return all;
  }

  // Returns what the filter of a place needs, from the cache where it is there.
  Values place(const std::string& graph, const Place& place_mm) const {
    const auto key = std::make_pair(graph, place_mm);
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (const auto found = places_.find(key); found != places_.end()) return found->second;
    }
    Values values = run(graph, {{"place_mm", engine_.tensor(place_mm)}});
    std::size_t bytes = 0;
    for (const auto& [name, value] : values) bytes += engine_.data<float>(value).second * sizeof(float);
    const std::lock_guard<std::mutex> lock(mutex_);
    if (cached_bytes_ + bytes <= options_.cache_bytes && places_.emplace(key, values).second) cached_bytes_ += bytes;
    return values;
  }

  // Returns demosaicked and restored planes, (6, h, w): blocks, windowed and added, place by place.
  template <class Tell>
  Picture restore(const Capture& capture, const Known& known, const Tell& tell) const {
    const detail::Json &bank = about_["bank"], &within = bank["mosaic_within_mm"];
    const int block = bank["block_px"].integer(), margin = bank["margin_px"].integer();
    const bool lights = bank["lights"].truth();
    detail::check(margin >= 0 && margin < block && block < (1 << 12), "the manifest's blocks are damaged");
    const Point red = about_["sensor"]["red_px"].pair();
    const auto [x, y] = capture.origin_px;  // an odd one begins with another colour
    const Spans down = spans(capture.height, known.axis[1], (int(red[1]) + y) & 1, block, margin);
    const Spans across = spans(capture.width, known.axis[0], (int(red[0]) + x) & 1, block, margin);
    const Values whole = cleared(capture, known, {(int(red[0]) + x) & 1, (int(red[1]) + y) & 1});
    std::vector<std::pair<Place, std::vector<std::array<std::size_t, 2>>>> places;
    std::map<Place, std::size_t> numbers;
    for (std::size_t i = 0; i < down.turn.size(); ++i)
      for (std::size_t j = 0; j < across.turn.size(); ++j) {
        const Place at{across.place_mm[j], down.place_mm[i]};
        const auto [found, is_new] = numbers.emplace(at, places.size());
        if (is_new) places.push_back({at, {}});
        places[found->second].second.push_back({i, j});
      }
    Picture total(6, capture.height, capture.width);
    double done = 0;
    for (const auto& [at, blocks] : places) {
      const bool is_near = within.kind == detail::Json::Kind::number && std::hypot(double(at[0]), double(at[1])) <= within.number();
      const std::string kind = is_near ? "_mosaic" : "";
      Values values = place("place" + kind, at);
      values.insert(whole.begin(), whole.end());
      for (const auto& [i, j] : blocks) {
        std::vector<float> mosaic = cut(capture, down, across, i, j, block + 2 * margin);
        const bool lit = lights && clips(mosaic, block, margin, known.clip);
        const std::array<std::int64_t, 1> phase{2 * down.phase[i] + across.phase[j]};
        values["mosaic"] = engine_.tensor(mosaic, {block + 2 * margin, block + 2 * margin});
        values["phase"] = engine_.tensor(phase);
        const std::size_t lines = std::size_t(block + 2 * margin);
        values["row_index"] = engine_.tensor(&down.index[i * lines], lines, {block + 2 * margin});
        values["column_index"] = engine_.tensor(&across.index[j * lines], lines, {block + 2 * margin});
        values["window_y"] = engine_.tensor(&down.window[i * std::size_t(block)], std::size_t(block), {block});
        values["window_x"] = engine_.tensor(&across.window[j * std::size_t(block)], std::size_t(block), {block});
        const Values made = run("block" + kind + (lit ? "_lights" : ""), values);
        add(floats(made, "out", 6 * std::size_t(block) * std::size_t(block)), block, down, across, i, j, total);
        tell(++done / double(down.turn.size() * across.turn.size()));
      }
    }
    return total;
  }

  // Returns what is known of the capture; a haze is found in coarse cells of all of it.
  Values cleared(const Capture& capture, const Known& known, const std::array<std::int64_t, 2>& red) const {
    Values values = known.values;
    const detail::Json* haze = about_.find("haze");
    if (!haze || haze->kind == detail::Json::Kind::null) return values;
    const std::size_t count = std::size_t(capture.height) * std::size_t(capture.width);
    const std::vector<float> mosaic(capture.samples, capture.samples + count);
    values["mosaic"] = engine_.tensor(mosaic, {capture.height, capture.width});
    values["red_px"] = engine_.tensor(red);
    Values cells = run("cells", values);
    cells["axis_px"] = engine_.tensor(known.axis);
    const Values made = run("haze", cells);
    values = known.values;
    values.insert(made.begin(), made.end());
    return values;
  }

  static std::vector<float> cut(const Capture& capture, const Spans& down, const Spans& across, std::size_t i,
                                std::size_t j, int side) {
    const std::int64_t *y = &down.index[i * std::size_t(side)], *x = &across.index[j * std::size_t(side)];
    std::vector<float> mosaic(std::size_t(side) * std::size_t(side));
    float* to = mosaic.data();
    for (int row = 0; row < side; ++row) {
      const std::uint16_t* from = capture.samples + y[row] * capture.width;
      for (int column = 0; column < side; ++column) *to++ = from[x[column]];
    }
    return mosaic;
  }

  static bool clips(const std::vector<float>& mosaic, int block, int margin, float clip) {
    for (int row = margin; row < block + margin; ++row) {
      const float* first = mosaic.data() + row * (block + 2 * margin) + margin;
      if (*std::max_element(first, first + block) >= clip) return true;
    }
    return false;
  }

  static void add(const float* out, int block, const Spans& down, const Spans& across, std::size_t i, std::size_t j,
                  Picture& total) {
    const int y = int(down.first_px[i]), x = int(across.first_px[j]);
    const int top = std::max(y, 0), bottom = std::min(y + block, total.height);
    const int left = std::max(x, 0), right = std::min(x + block, total.width);
    for (int c = 0; c < 6; ++c)
      for (int row = top; row < bottom; ++row) {
        const int of = down.turn[i] < 0 ? block - 1 - (row - y) : row - y;
        const float* from = out + (std::size_t(c) * std::size_t(block) + std::size_t(of)) * std::size_t(block);
        float* to = total.row(c, row);
        if (across.turn[j] < 0)
          for (int column = left; column < right; ++column) to[column] += from[block - 1 - (column - x)];
        else
          for (int column = left; column < right; ++column) to[column] += from[column - x];
      }
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
    const int most = (*network_)["tile_px"].integer();
    detail::check(stride > 0 && stride < (1 << 12), "the manifest's tiles are damaged");
    const auto whole = [stride](int size) { return (size + stride - 1) / stride * stride; };
    const auto [rows, h] = detail::tiles(whole(planes.height), most, halo, stride);
    const auto [columns, w] = detail::tiles(whole(planes.width), most, halo, stride);
    Picture even(3, planes.height, planes.width);
    const double pitch_mm = about_["sensor"]["pitch_mm"].number();
    Values values = known.values;
    double done = 0;
    for (const detail::Tile& y : rows)
      for (const detail::Tile& x : columns) {
        const std::vector<float> box = cut(planes, y.first, x.first, h, w), share = cut(kept, y.first, x.first, h, w);
        const std::array<float, 2> origin{float((x.first - known.axis[0]) * pitch_mm),
                                          float((y.first - known.axis[1]) * pitch_mm)};
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
    const Point middle{(even.width - 1) / 2.0, (even.height - 1) / 2.0};
    Picture straight(3, even.height, even.width);
    for (int y = 0; y < even.height; y += side)
      for (int x = 0; x < even.width; x += side) {
        const std::array<int, 2> at{x, y};
        const Point target{double(x), double(y)};
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
  std::map<std::string, detail::Table> tables_;
  std::map<std::string, detail::Graph> graphs_;
  mutable std::mutex mutex_;  // of what is below: sessions may run in several threads
  mutable std::map<std::pair<std::string, Place>, Values> places_;
  mutable std::size_t cached_bytes_ = 0;
};

}  // namespace camkit
