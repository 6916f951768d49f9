// BTFs as files, in two forms of one content.
//
// factored: "facet_radiance" [channel][light][facet] halves and "view_maps" [view][sample][row][column], the
// facet that each place of a pixel shows. 20 times smaller than the images, and nothing is lost. images:
// "images" [view][light][channel][row][column], halves: each the value of its facet, or the mean of its
// samples in float.
//
// Both begin with "mean", "mean_se", "mean_bias" [channel][light][view] and "pixel_se" [channel][light],
// floats in 1/sr (core/measure/btf.h), and are files of arrays (array_file.h). The images may also be an .npy
// file (npy_file.h) of the same halves, whose last line holds those means. expand_btf makes either from the
// factored form, to the last bit what the same job would write.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "base/monitor.h"
#include "measure/btf.h"
#include "measure/glossy_btf.h"
#include "server/run_job.h"

namespace gonio {

// What a job of kind btf or light_field asks for.
const BtfPlan& pictures_of(const LoadedJob& job);

enum class ImageForm { arrays, npy };
// Of the outputs that are images: "images", "npy".
std::optional<ImageForm> image_form(const std::string& format);

void write_factored_btf(const LoadedJob& job, const Btf& btf, const std::string& path);
// Streamed, the images of one view at a time.
void write_btf_images(const LoadedJob& job, const Btf& btf, ImageForm form, const std::string& path,
                      const Monitor& monitor);

// Of glossy facets: measured while all of `files` that are images are written, one view after the other,
// which on_view is shown, too; in the file of arrays `images` comes before the means. There is no factored
// form: a facet sends another radiance to every view.
Btf write_glossy_images(const LoadedJob& job, GlossyBtf& glossy, const std::vector<OutputRequest>& files,
                        const GlossyPictures::OnView& on_view);

// A factored file, read and checked. Throws Error for anything else.
struct StoredBtf {
    std::string head;  // its first line without "arrays"
    Btf btf;           // without what `mean` says about directions and provenance
};
StoredBtf read_factored_btf(const std::string& path);
void expand_btf(const std::string& factored, ImageForm form, const std::string& images,
                const Monitor& monitor);

}  // namespace gonio
