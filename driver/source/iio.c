// SPDX-License-Identifier: GPL-2.0-only
/*
 * incise_source.ko: positions for a plan from a channel of the IIO subsystem, an encoder's count
 * say. The channel belongs to the controller: `io-channels` of its firmware node,
 * or an iio_map of the board; exactly one, of a device with a buffer. incise_stepper.ko does
 * without IIO.
 *
 *   trigger ─▶ driver of the encoder ─▶ IIO's buffers ─▶ store_to() ─▶ plan
 *                                            └▶ what else reads it
 *
 * The kernel's own callback buffer (CONFIG_IIO_BUFFER_CB) does the same, but distributions leave it
 * out, and it hands on no timestamps. Timestamps are the device's where its clock is
 * CLOCK_MONOTONIC (current_timestamp_clock), else the time at which the sample got here.
 *
 * The trigger and its rate are set up as for any other use of the device, before LOAD_PLAN.
 */
#include <linux/err.h>
#include <linux/iio/buffer_impl.h>
#include <linux/iio/consumer.h>
#include <linux/iio/iio.h>
#include <linux/bitmap.h>
#include <linux/ktime.h>
#include <linux/log2.h>
#include <linux/module.h>
#include <linux/slab.h>

#include "../incise_source.h"

struct source {
	struct iio_buffer buffer;
	struct iio_channel *channels;
	struct incise_stepper_sink *sink;
	unsigned int storagebits, realbits, shift;
	bool is_signed, big;
	bool stamped;
};

static struct source *to_source(struct iio_buffer *buffer)
{
	return container_of(buffer, struct source, buffer);
}

/* The number that a sample stands for; IIO aligns it. */
static s64 source_raw(const struct source *source, const void *data)
{
	u64 raw;

	switch (source->storagebits) {
	case 8:
		raw = *(const u8 *)data;
		break;
	case 16:
		raw = source->big ? be16_to_cpup(data) : le16_to_cpup(data);
		break;
	case 32:
		raw = source->big ? be32_to_cpup(data) : le32_to_cpup(data);
		break;
	default:
		raw = source->big ? be64_to_cpup(data) : le64_to_cpup(data);
	}
	raw >>= source->shift;
	if (source->is_signed)
		return sign_extend64(raw, source->realbits - 1);
	return raw & GENMASK_ULL(source->realbits - 1, 0);
}

/* A scan: the channel, and behind it the timestamp, aligned. */
static int source_store(struct iio_buffer *buffer, const void *data)
{
	struct source *source = to_source(buffer);
	unsigned int at = ALIGN(source->storagebits / 8, sizeof(s64));
	s64 t_ns;

	if (source->stamped)
		memcpy(&t_ns, data + at, sizeof(t_ns));
	else
		t_ns = ktime_get_ns();
	incise_stepper_source_push(source->sink, source_raw(source, data), t_ns);
	return 0;
}

static void source_release(struct iio_buffer *buffer)
{
	struct source *source = to_source(buffer);

	bitmap_free(buffer->scan_mask);
	kfree(source);
}

static const struct iio_buffer_access_funcs source_access = {
	.store_to = source_store,
	.release = source_release,
	.modes = INDIO_BUFFER_SOFTWARE | INDIO_BUFFER_TRIGGERED,
};

/* One channel, of a kind that a buffer has. */
static int source_check(struct source *source)
{
	const struct iio_channel *channel = source->channels;
	const struct iio_chan_spec *spec = channel->channel;

	if (channel[1].indio_dev || spec->scan_index < 0 || spec->type == IIO_TIMESTAMP)
		return -EINVAL;
	source->storagebits = spec->scan_type.storagebits;
	source->realbits = spec->scan_type.realbits;
	source->shift = spec->scan_type.shift;
	source->is_signed = spec->scan_type.sign == 's';
	source->big = spec->scan_type.endianness == IIO_BE ||
		      (spec->scan_type.endianness == IIO_CPU &&
		       IS_ENABLED(CONFIG_CPU_BIG_ENDIAN));
	if (!source->realbits || source->realbits + source->shift > source->storagebits)
		return -EINVAL;
	return source->storagebits <= 64 && is_power_of_2(source->storagebits / 8) &&
			       source->storagebits % 8 == 0
		       ? 0
		       : -EINVAL;
}

/* The channel, and the device's timestamp if it is of our clock. */
static int source_mask(struct source *source)
{
	struct iio_dev *iio = source->channels->indio_dev;
	struct iio_buffer *buffer = &source->buffer;
	int i, most = 0;

	for (i = 0; i < iio->num_channels; i++) {
		const struct iio_chan_spec *spec = &iio->channels[i];

		most = max(most, spec->scan_index);
		if (spec->type == IIO_TIMESTAMP && spec->scan_index >= 0 &&
		    iio_device_get_clock(iio) == CLOCK_MONOTONIC)
			source->stamped = true;
	}
	buffer->scan_mask = bitmap_zalloc(most + 1, GFP_KERNEL);
	if (!buffer->scan_mask)
		return -ENOMEM;
	set_bit(source->channels->channel->scan_index, buffer->scan_mask);
	/* IIO takes care of the timestamp by this, not by the mask. */
	buffer->scan_timestamp = source->stamped;
	return 0;
}

static void *source_open(struct device *controller, struct incise_stepper_sink *sink)
{
	struct source *source = kzalloc(sizeof(*source), GFP_KERNEL);
	int ret;

	if (!source)
		return ERR_PTR(-ENOMEM);
	source->sink = sink;
	iio_buffer_init(&source->buffer);
	source->buffer.access = &source_access;
	source->channels = iio_channel_get_all(controller);
	if (IS_ERR(source->channels)) {
		ret = PTR_ERR(source->channels);
		goto put;
	}
	ret = source_check(source);
	if (!ret)
		ret = source_mask(source);
	if (!ret)
		ret = iio_update_buffers(source->channels->indio_dev, &source->buffer,
					 NULL);
	if (!ret)
		return source;
	iio_channel_release_all(source->channels);
put:
	iio_buffer_put(&source->buffer);
	return ERR_PTR(ret);
}

static void source_close(void *opened)
{
	struct source *source = opened;

	/* The device may have gone: then it has let the buffer go before. */
	iio_update_buffers(source->channels->indio_dev, NULL, &source->buffer);
	iio_channel_release_all(source->channels);
	iio_buffer_put(&source->buffer);
}

static const struct incise_stepper_source_ops source_ops = {
	.owner = THIS_MODULE,
	.open = source_open,
	.close = source_close,
};

static int __init source_init(void)
{
	return incise_stepper_source_register(&source_ops);
}
module_init(source_init);

static void __exit source_exit(void)
{
	incise_stepper_source_unregister(&source_ops);
}
module_exit(source_exit);

MODULE_DESCRIPTION("Positions of an IIO channel for plans of incise_stepper");
MODULE_AUTHOR("The incise authors");
MODULE_LICENSE("GPL");
