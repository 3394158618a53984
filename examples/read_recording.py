from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

with open("run.mcap", "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    for _, _, message, tick in reader.iter_decoded_messages(topics=["/flotor/tick"]):
        print(tick.time_ns, tick.commanded.force_n.z)
