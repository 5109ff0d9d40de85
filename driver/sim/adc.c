// SPDX-License-Identifier: GPL-2.0-only
/*
 * The IIO device: one voltage channel of 12 bits, +-2500 mV, and a timestamp
 * in the clock of current_timestamp_clock, in a triggered buffer.
 *
 *	mV = (raw - 2048) * 5000 / 4096
 *
 * Its own trigger is a hard timer, so that it also is there on kernels
 * without iio-trig-hrtimer (6.1). Every period is a conversion, even when the
 * thread has not yet handed over the one before: IIO would leave that trigger
 * out, hardware with a store would not.
 *
 *	timer    |     |     |     |     |
 *	convert  x     x     x     x     x
 *	thread    >      >>>>>>>>>   >>    >
 */
#include <linux/device.h>
#include <linux/iio/buffer.h>
#include <linux/iio/driver.h>
#include <linux/iio/iio.h>
#include <linux/iio/trigger.h>
#include <linux/iio/trigger_consumer.h>
#include <linux/iio/triggered_buffer.h>
#include <linux/module.h>
#include <linux/sysfs.h>

#include "../compat.h"
#include "adc.h"

/* A sample as IIO stores it. */
struct sim_scan {
	u16 value;
	u16 filler[3];
	s64 t_ns;
};

static const struct iio_chan_spec sim_adc_channels[] = {
	{
		.type = IIO_VOLTAGE,
		.indexed = 1,
		.channel = 0,
		.info_mask_separate = BIT(IIO_CHAN_INFO_RAW) | BIT(IIO_CHAN_INFO_SCALE) |
				      BIT(IIO_CHAN_INFO_OFFSET),
		.info_mask_shared_by_all = BIT(IIO_CHAN_INFO_SAMP_FREQ),
		.scan_index = 0,
		.scan_type.sign = 'u',
		.scan_type.realbits = 12,
		.scan_type.storagebits = 16,
		.scan_type.endianness = IIO_CPU,
	},
	IIO_CHAN_SOFT_TIMESTAMP(1),
};

static struct sim_adc *sim_adc_of(struct iio_dev *iio)
{
	return *(struct sim_adc **)iio_priv(iio);
}

static int sim_adc_set_frequency(struct sim_adc *adc, int hertz)
{
	if (hertz < 1 || hertz > INCISE_SIM_ADC_HZ_MAX)
		return -EINVAL;
	WRITE_ONCE(adc->frequency, hertz);
	return 0;
}

static int sim_adc_read_raw(struct iio_dev *iio, struct iio_chan_spec const *channel,
			    int *val, int *val2, long info)
{
	struct sim_adc *adc = sim_adc_of(iio);

	switch (info) {
	case IIO_CHAN_INFO_RAW:
		/* While the buffer runs samples are the buffer's only. */
		*val = iio_buffer_enabled(iio) ? READ_ONCE(adc->value)
					       : sim_adc_convert(adc);
		return IIO_VAL_INT;
	case IIO_CHAN_INFO_SCALE:
		*val = 5000;
		*val2 = 12;
		return IIO_VAL_FRACTIONAL_LOG2;
	case IIO_CHAN_INFO_OFFSET:
		*val = -INCISE_SIM_ADC_ZERO;
		return IIO_VAL_INT;
	case IIO_CHAN_INFO_SAMP_FREQ:
		*val = READ_ONCE(adc->frequency);
		return IIO_VAL_INT;
	default:
		return -EINVAL;
	}
}

static int sim_adc_write_raw(struct iio_dev *iio, struct iio_chan_spec const *channel,
			     int val, int val2, long info)
{
	if (info != IIO_CHAN_INFO_SAMP_FREQ || val2)
		return -EINVAL;
	return sim_adc_set_frequency(sim_adc_of(iio), val);
}

static const struct iio_info sim_adc_info = {
	.read_raw = sim_adc_read_raw,
	.write_raw = sim_adc_write_raw,
};

static int sim_adc_preenable(struct iio_dev *iio)
{
	sim_adc_start(sim_adc_of(iio));
	return 0;
}

static const struct iio_buffer_setup_ops sim_adc_setup_ops = {
	.preenable = sim_adc_preenable,
};

static irqreturn_t sim_adc_trigger(int irq, void *private)
{
	struct iio_poll_func *poll = private;

	sim_adc_convert_to_fifo(sim_adc_of(poll->indio_dev));
	return IRQ_WAKE_THREAD;
}

static irqreturn_t sim_adc_thread(int irq, void *private)
{
	struct iio_poll_func *poll = private;
	struct iio_dev *iio = poll->indio_dev;
	struct sim_adc *adc = sim_adc_of(iio);
	struct sim_conversion conversion;
	unsigned long flags;

	while (sim_adc_take(adc, &conversion)) {
		struct {
			u16 value;
			aligned_s64 t_ns;
		} scan = {.value = conversion.value};
		int ret;

		ret = iio_push_to_buffers_with_timestamp(iio, &scan, conversion.t_ns);
		raw_spin_lock_irqsave(&adc->lock, flags);
		if (ret)
			adc->overflows++;
		else
			adc->pushed++;
		raw_spin_unlock_irqrestore(&adc->lock, flags);
	}
	iio_trigger_notify_done(iio->trig);
	return IRQ_HANDLED;
}

static ktime_t sim_trigger_period(const struct sim_adc *adc)
{
	return ns_to_ktime(NSEC_PER_SEC / READ_ONCE(adc->frequency));
}

static enum hrtimer_restart sim_trigger_fire(struct hrtimer *timer)
{
	struct sim_adc *adc = container_of(timer, struct sim_adc, timer);
	unsigned long flags;
	u64 periods;

	periods = hrtimer_forward_now(timer, sim_trigger_period(adc));
	if (periods > 1) {
		raw_spin_lock_irqsave(&adc->lock, flags);
		adc->skipped += periods - 1;
		raw_spin_unlock_irqrestore(&adc->lock, flags);
	}
	if (atomic_read(&adc->trigger->use_count))
		sim_adc_convert_to_fifo(adc);
	else
		iio_trigger_poll(adc->trigger);
	return HRTIMER_RESTART;
}

static int sim_trigger_switch(struct iio_trigger *trigger, bool on)
{
	struct sim_adc *adc = iio_trigger_get_drvdata(trigger);

	if (on)
		hrtimer_start(&adc->timer,
			      ktime_add(ktime_get(), sim_trigger_period(adc)),
			      HRTIMER_MODE_ABS_HARD);
	else
		hrtimer_cancel(&adc->timer);
	return 0;
}

static const struct iio_trigger_ops sim_trigger_ops = {
	.set_trigger_state = sim_trigger_switch,
	.validate_device = iio_trigger_validate_own_device,
};

static ssize_t sampling_frequency_show(struct device *dev, struct device_attribute *attr,
				       char *to)
{
	struct sim_adc *adc = iio_trigger_get_drvdata(to_iio_trigger(dev));

	return sysfs_emit(to, "%u\n", READ_ONCE(adc->frequency));
}

static ssize_t sampling_frequency_store(struct device *dev, struct device_attribute *attr,
					const char *from, size_t size)
{
	struct sim_adc *adc = iio_trigger_get_drvdata(to_iio_trigger(dev));
	int hertz, ret;

	ret = kstrtoint(from, 10, &hertz);
	if (!ret)
		ret = sim_adc_set_frequency(adc, hertz);
	return ret ? ret : size;
}
static DEVICE_ATTR_RW(sampling_frequency);

static struct attribute *sim_trigger_attrs[] = {
	&dev_attr_sampling_frequency.attr,
	NULL,
};
ATTRIBUTE_GROUPS(sim_trigger);

static int sim_trigger_add(struct sim_adc *adc, struct device *parent)
{
	struct iio_trigger *trigger;
	int ret;

	/*
	 * No owner: as the default trigger of a device in the same module it
	 * would hold the module for ever. No other driver may use it.
	 */
	trigger = __iio_trigger_alloc(parent, NULL, "%s", INCISE_SIM_TRIGGER);
	if (!trigger)
		return -ENOMEM;
	trigger->ops = &sim_trigger_ops;
	trigger->dev.groups = sim_trigger_groups;
	iio_trigger_set_drvdata(trigger, adc);
	hrtimer_setup(&adc->timer, sim_trigger_fire, CLOCK_MONOTONIC,
		      HRTIMER_MODE_ABS_HARD);
	ret = iio_trigger_register(trigger);
	if (ret) {
		iio_trigger_free(trigger);
		return ret;
	}
	adc->trigger = trigger;
	return 0;
}

static void sim_trigger_remove(struct sim_adc *adc)
{
	iio_trigger_unregister(adc->trigger);
	hrtimer_cancel(&adc->timer);
	iio_trigger_free(adc->trigger);
}

int sim_adc_add(struct sim_adc *adc, struct device *parent)
{
	struct iio_dev *iio;
	int ret;

	adc->frequency = 1000;
	iio = iio_device_alloc(parent, sizeof(adc));
	if (!iio)
		return -ENOMEM;
	*(struct sim_adc **)iio_priv(iio) = adc;
	adc->iio = iio;
	iio->name = INCISE_SIM_ADC;
	iio->info = &sim_adc_info;
	iio->modes = INDIO_DIRECT_MODE;
	iio->channels = sim_adc_channels;
	iio->num_channels = ARRAY_SIZE(sim_adc_channels);

	ret = sim_trigger_add(adc, parent);
	if (ret)
		goto out_free_device;
	iio->trig = iio_trigger_get(adc->trigger);
	ret = iio_triggered_buffer_setup(iio, sim_adc_trigger, sim_adc_thread,
					 &sim_adc_setup_ops);
	if (ret)
		goto out_remove_trigger;
	ret = iio_device_register(iio);
	if (ret)
		goto out_cleanup_buffer;
	return 0;

out_cleanup_buffer:
	iio_triggered_buffer_cleanup(iio);
out_remove_trigger:
	sim_trigger_remove(adc);
out_free_device:
	iio_device_free(iio);
	return ret;
}

void sim_adc_remove(struct sim_adc *adc)
{
	iio_device_unregister(adc->iio);
	iio_triggered_buffer_cleanup(adc->iio);
	sim_trigger_remove(adc);
	iio_device_free(adc->iio);
}
